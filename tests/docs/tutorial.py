"""Run the commands of a tutorial and compare their output with the page.

A block ``sh`` holds commands, the block ``text`` after it what they print. A line ``…`` in it
stands for any lines. Numbers may differ by `TOLERANCE`, or by one in the last digit.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

BLOCK = re.compile(r"^```(sh|text)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
TOLERANCE = 0.05
SKIPPED = ("make ", "source ")
"""Commands that a test does not run: they make an environment"""
INSTALL = re.compile(r"^pip install (\./\S+)$", re.MULTILINE)


@dataclass(frozen=True)
class Step:
    """Commands and the output that the page shows; None if it shows none."""

    commands: str
    shown: str | None


def steps(page: str) -> list[Step]:
    """Return the steps of a page in their order."""
    found: list[Step] = []
    for kind, text in BLOCK.findall(page):
        if kind == "sh":
            found.append(Step(text, None))
        elif found and found[-1].shown is None:
            found[-1] = Step(found[-1].commands, text)
    return found


def run(commands: str, folder: Path) -> str:
    """Run commands by sh in ``folder``; return stdout and stderr together. Raises if one fails.

    A package is installed into ``folder/installed``, where the later commands find it.
    """
    installed = folder / "installed"
    lines = [line for line in commands.splitlines() if not line.startswith(SKIPPED)]
    kept = INSTALL.sub(
        rf"python -m pip install --quiet --no-deps --target {installed} \1", "\n".join(lines)
    )
    environment = {
        **os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
        "COLUMNS": "120", "PYTHONIOENCODING": "utf-8", "PYTHONPATH": str(installed),
    }  # fmt: skip
    done = subprocess.run(
        ["sh", "-ec", kept], cwd=folder, env=environment, text=True, encoding="utf-8",
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    assert done.returncode == 0, f"{commands}\n{done.stdout}"
    return done.stdout


def difference(shown: str, printed: str) -> str:
    """Return what of the ``shown`` lines was not ``printed`` in this order; empty if all was.

    >>> difference("yaw 1.48°\\n…\\nGood.\\n", "yaw 1.49°\\nand more\\nGood.\\n")
    ''
    >>> difference("yaw 1.48°\\n", "yaw 2.48°\\n")
    'yaw 1.48°'
    """
    words = printed.split()  # so that a page may break lines elsewhere than the terminal
    at = 0
    for part in re.split(r"^…$", shown, flags=re.MULTILINE):
        wanted = part.split()
        while wanted and not _alike(wanted, words[at : at + len(wanted)]):
            at += 1
            if at + len(wanted) > len(words):
                return " ".join(wanted)
        at += len(wanted)
    return ""


def _alike(shown: list[str], printed: list[str]) -> bool:
    return len(shown) == len(printed) and all(map(_same_word, shown, printed))


def _same_word(shown: str, printed: str) -> bool:
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    return all(map(_same_number, NUMBER.findall(shown), NUMBER.findall(printed)))


def _same_number(shown: str, printed: str) -> bool:
    a, b = (float(x.replace("−", "-")) for x in (shown, printed))
    last_digit = 10.0 ** -len(shown.partition(".")[2].partition("e")[0])
    return abs(a - b) <= max(TOLERANCE * abs(a), 1.01 * last_digit)
