"""The table of integrity checks in diagnosis.md, made from the checks themselves."""

from __future__ import annotations

from heli3dof.diagnosis.integrity import Stage, checks
from tests.pages.page import Page, table

EXAMINES = {
    Stage.CLOCK: "the clock",
    Stage.COLUMNS: "the columns",
    Stage.VALUES: "the values",
    Stage.MOTION: "the motion",
}


def checks_table() -> str:
    """Markdown: a row for every check, in the order in which they run."""
    rows = [[f"`{c.name}`", EXAMINES[c.stage], c.tells] for c in checks()]
    return table(["check", "examines", "reports"], rows)


PAGE = Page("docs/explanation/diagnosis.md", {"integrity": checks_table})
