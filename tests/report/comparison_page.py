"""The generated part of docs/comparison.md: ``python -m tests.report.comparison_page``."""

from __future__ import annotations

from heli3dof.model.linear.hover import hover_model
from heli3dof.paper.reproduction import reproduce
from heli3dof.report.comparison_tables import published_table
from heli3dof.report.text_table import to_markdown
from heli3dof.rig.profile import default_profile
from tests.paths import ROOT

PAGE = ROOT / "docs" / "comparison.md"
START, END = "<!-- published -->\n", "<!-- /published -->\n"


def generated() -> str:
    """The published table with what the hover model gives today."""
    table = published_table(reproduce(hover_model(default_profile())))
    return "\n" + to_markdown(table) + "\n"


def renewed(page: str) -> str:
    """The page with its generated part made again."""
    before, rest = page.split(START)
    _, after = rest.split(END)
    return before + START + generated() + END + after


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
