"""The list of levels in exercise.md."""

from __future__ import annotations

from heli3dof.exercise.levels import LEVELS, SPREAD
from tests.pages.page import Page


def levels() -> str:
    """Markdown: what each level hides."""
    lines = [f"- `--level {level}`: {what}" for level, what in LEVELS.items()]
    return "\n".join([*lines, "", f"From level 4 these numbers differ by up to {SPREAD:.0%}."])


PAGE = Page("docs/how-to/exercise.md", {"levels": levels})
