"""``python -m tests.docs.reader_sample [SEED]``: 40 docstrings and 40 paragraphs, drawn at random.

They are for a reader who knows control and has only the rules of writing. The reader marks each
text that a first reading does not make clear; at least 76 of 80 are to be clear.
"""

from __future__ import annotations

import ast
import random
import sys
from collections.abc import Iterator

from tests.docs.wording import ROOT, paragraphs, tracked

EACH = 40
"""texts of each kind"""
SHORTEST = 6
"""words: a shorter text is a label"""


def docstrings() -> Iterator[tuple[str, str]]:
    """(place, text) of every docstring of the packages, with the signature that it belongs to."""
    for file in tracked("heli3dof/*.py", "drivers/*.py"):
        for node in ast.walk(ast.parse((ROOT / file).read_text(encoding="utf-8"))):
            if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef):
                text = ast.get_docstring(node)
                if text and len(text.split()) >= SHORTEST:
                    name = "" if isinstance(node, ast.Module) else f" {node.name}{_arguments(node)}"
                    yield f"{file}{name}", text


def _arguments(node: ast.ClassDef | ast.FunctionDef) -> str:
    return f"({ast.unparse(node.args)})" if isinstance(node, ast.FunctionDef) else ""


def doc_paragraphs() -> Iterator[tuple[str, str]]:
    """(place, text) of every paragraph of prose in the docs."""
    for file in tracked("docs/*.md", "README.md", "CONTRIBUTING.md"):
        text = (ROOT / file).read_text(encoding="utf-8")
        for line, paragraph in paragraphs(text):
            if len(paragraph.split()) >= SHORTEST and not paragraph.startswith("#"):
                yield f"{file}:{line}", paragraph


def main() -> None:
    """Print the sample, numbered."""
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else 15
    rng = random.Random(seed)
    drawn = rng.sample(list(docstrings()), EACH) + rng.sample(list(doc_paragraphs()), EACH)
    for number, (place, text) in enumerate(drawn, 1):
        print(f"--- {number} · {place}\n{text}\n")


if __name__ == "__main__":
    main()
