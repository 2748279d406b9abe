"""The table of integrity checks in diagnosis.md, made from the checks themselves."""

from __future__ import annotations

from heli3dof.integrity import checks
from tests.pages.page import Page, table


def checks_table() -> str:
    """Markdown: a row for every check, in the order in which they run."""
    return table(["check", "reports"], [[f"`{c.name}`", c.reports] for c in checks()])


PAGE = Page("docs/explanation/diagnosis.md", {"integrity": checks_table})
