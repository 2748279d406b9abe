"""The table of published numbers in docs/results/published.md."""

from __future__ import annotations

from heli3dof.model.linear.hover import hover_model
from heli3dof.paper.reproduction import reproduce
from heli3dof.report.text.comparison_tables import published_table
from heli3dof.rig.profile import default_profile
from tests.pages.markdown_table import to_markdown
from tests.pages.page import Page


def _published() -> str:
    """The published numbers and what the hover model gives today."""
    return to_markdown(published_table(reproduce(hover_model(default_profile())))).rstrip("\n")


PAGE = Page("docs/results/published.md", {"published": _published})
