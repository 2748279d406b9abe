"""A page of the documentation with blocks that the code computes.

A block stands between ``<!-- NAME: made by python -m tests.pages -->`` and
``<!-- end of NAME -->``. ``python -m tests.pages`` rewrites every block of every page.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.paths import ROOT

COMMAND = "python -m tests.pages"


@dataclass(frozen=True)
class Page:
    """One Markdown file and the functions that compute its blocks."""

    file: str
    """path from the repository's root"""
    blocks: Mapping[str, Callable[[], str]]
    """Markdown without the last line's end, by the block's name"""
    slow: bool = False
    """Its blocks take over ten seconds: ``make test-accuracy`` compares them, not ``make test``"""

    @property
    def path(self) -> Path:
        return ROOT / self.file

    def read(self) -> str:
        """The file's text as it is now."""
        return self.path.read_text(encoding="utf-8")

    def renewed(self, text: str) -> str:
        """The text with every block computed again. Raises ValueError for a missing marker."""
        for name, compute in self.blocks.items():
            begin = f"<!-- {name}: made by {COMMAND} -->"
            end = f"<!-- end of {name} -->"
            before, begins, rest = text.partition(begin)
            _, ends, after = rest.partition(end)
            if not (begins and ends):
                raise ValueError(f"{self.file} has no {begin} … {end}")
            text = f"{before}{begin}\n{compute()}\n{end}{after}"
        return text

    def rewrite(self) -> bool:
        """Write the renewed text to the file; true if it changed."""
        old = self.read()
        new = self.renewed(old)
        if new != old:
            self.path.write_text(new, encoding="utf-8")
        return new != old


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; a bar inside a cell is escaped.

    >>> print(table(["a", "b"], [["1", "x|y"]]))
    | a | b |
    |---|---|
    | 1 | x\\|y |
    """
    lines = [head, ["---"] * len(head), *rows]
    text = ["| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines]
    text[1] = text[1].replace(" ", "")
    return "\n".join(text)
