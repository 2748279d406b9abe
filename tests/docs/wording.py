"""``python -m tests.docs.wording``: words outside the glossary, and long sentences in the docs.

A word is reported wherever it stands in tracked text. `ALLOWED` lists the legitimate uses, each
with its reason. In Markdown, sentences of more than `LONGEST` words are reported; tables, code and
generated blocks are not sentences.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
FILES = ("*.py", "*.md", "*.toml", "*.c", "*.h", "Makefile")
LONGEST = 35
"""words in a sentence of the docs"""
UNREAD = ("tests/golden/documents/", "CHANGELOG.md", "tests/docs/", "docs/results/data/")
"""Recorded data, history, and the list itself with its tests"""

INSTEAD = {
    r"anew": "again",
    r"forete(?:ll|lls|lling)|foretold": "predict",
    r"surely": "certainly, or nothing",
    r"mend|mends|mended|mending": "correct, fix",
    r"whoever": "the person, the process",
    r"nobody": "no one, or name the actor",
    r"thereof|hitherto": "of it, so far",
    r"chatters?": "limit cycle on one count",
    r"leftovers?": "residual torque",
    r"free(?:ly predicted| flights?)": "free-run prediction",
    r"tells? of|told|is said": "state, report, print",
    r"is asked": "name who asks what",
    r"stood still": "was at rest, did not change",
    r"doors?": "device, port, transport",
    r"that which|the very": "what, the same",
    r"loop is (?:un)?known|loop unknown": "controller known / unknown",
    r"by itself": "on its own, alone",
    r"no cause": "no effect was found",
    r"looks at|beside": "reads, with",
}
PATTERN = re.compile(r"\b(?:" + "|".join(INSTEAD) + r")\b", re.IGNORECASE)
ALLOWED: dict[str, str] = {
    "leftover": "a key of diagnose --json that the contract fixes",
    "loop_is_known": "a key of info --json",
    "paper-17-mended": "a name of an earlier version, still read with a warning",
    '"surely"': "a value of beyond_tolerance in diagnose --json",
}
"""What a line must contain for its hits to be legitimate, and why"""


class Place(NamedTuple):
    """A place to reword."""

    file: str
    line: int
    what: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.what}"


def words_in(file: str, text: str) -> Iterator[Place]:
    """Every use of a word that the glossary replaces."""
    for number, line in enumerate(text.splitlines(), 1):
        for match in PATTERN.finditer(line):
            if not any(reason in line for reason in ALLOWED):
                yield Place(file, number, f"{match.group(0)!r}: write {_instead(match.group(0))}")


def _instead(word: str) -> str:
    return next(better for old, better in INSTEAD.items() if re.fullmatch(old, word, re.IGNORECASE))


def long_sentences_in(file: str, text: str) -> Iterator[Place]:
    """Sentences of Markdown prose with more than `LONGEST` words; inline code counts as one."""
    for number, paragraph in paragraphs(text):
        paragraph = re.sub(r"`[^`]*`", "code", paragraph)
        for sentence in re.split(r"(?<=[.!?:;])\s+", paragraph):
            count = len(re.findall(r"\b[\w'’-]+\b", sentence))
            if count > LONGEST:
                yield Place(file, number, f"a sentence of {count} words: “{sentence[:50]}…”")


def paragraphs(text: str) -> Iterator[tuple[int, str]]:
    """(line number, text) of each paragraph of prose."""
    text = re.sub(r"<!-- \S+: made by.*?<!-- end of .*?-->", _blank, text, flags=re.DOTALL)
    text = re.sub(r"^( *)```.*?^\1```", _blank, text, flags=re.DOTALL | re.MULTILINE)
    start, lines = 0, list[str]()
    for number, line in enumerate([*text.splitlines(), ""], 1):
        starts = not line.strip() or re.match(r"\s*(?:[-*]\s|[#|]|\d+\.\s|    )", line)
        if starts and lines:
            yield start, " ".join(lines)
            lines = []
        if line.strip() and not line.lstrip().startswith("|"):
            start = start if lines else number
            lines.append(line.strip())


def _blank(match: re.Match[str]) -> str:
    return "\n" * match.group(0).count("\n")


def tracked(*patterns: str) -> list[str]:
    """Paths of tracked files from the top folder."""
    listed = subprocess.run(
        ["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return listed.stdout.splitlines()


def places() -> list[Place]:
    """Everything to reword in the tracked tree."""
    found: list[Place] = []
    for file in tracked(*FILES):
        if file.startswith(UNREAD):
            continue
        text = (ROOT / file).read_text(encoding="utf-8")
        found += words_in(file, text)
        if file.endswith(".md"):
            found += long_sentences_in(file, text)
    return found


def main() -> int:
    """Print the places; 1 where there are any."""
    found = places()
    for place in found:
        print(place)
    print(f"{len(found)} places to reword", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    raise SystemExit(main())
