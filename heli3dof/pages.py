"""Pages of the documentation whose tables are made by the code that they describe.

A page holds blocks between ``<!-- NAME: made by python -m MODULE -->`` and
``<!-- end of NAME -->``. The module that makes them says so in one line,
``PAGE = Page(MODULE, {NAME: its maker, …})``; ``python -m MODULE docs/page.md`` rewrites them, and
a test compares.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Page:
    """A module's blocks of one page."""

    module: str
    blocks: Mapping[str, Callable[[], str]]
    """Markdown without its last line's end, by the block's name"""

    def renewed(self, text: str) -> str:
        """The page with its blocks made anew; ValueError: a block has lost its markers."""
        for name, made in self.blocks.items():
            begin = f"<!-- {name}: made by python -m {self.module} -->"
            end = f"<!-- end of {name} -->"
            before, begins, rest = text.partition(begin)
            _, ends, after = rest.partition(end)
            if not (begins and ends):
                raise ValueError(f"the page has no {begin} … {end}")
            text = f"{before}{begin}\n{made()}\n{end}{after}"
        return text

    def main(self) -> None:
        """Rewrite the page that the command line names."""
        path = Path(sys.argv[1])
        path.write_text(self.renewed(path.read_text(encoding="utf-8")), encoding="utf-8")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Markdown; a bar in a cell stays a bar.

    >>> print(table(["a", "b"], [["1", "x|y"]]))
    | a | b |
    |---|---|
    | 1 | x\\|y |
    """
    lines = [head, ["---"] * len(head), *rows]
    text = ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]
    text[1] = text[1].replace(" ", "")
    return "\n".join(text)
