"""The table of integrity checks in diagnosis.md, made from the checks themselves."""

from __future__ import annotations

from heli3dof.integrity import checks
from tests.pages.page import Page, table

NOT_IMPORTED = "`log.refused`", "a log that cannot be imported"
"""The row of the fault that the import reports before any check runs"""


def checks_table() -> str:
    """Markdown: a row for every check, in the order in which they run."""
    rows = [(", ".join(f"`{n}`" for n in c.faults or (c.name,)), c.reports) for c in checks()]
    return table(["check", "reports"], [NOT_IMPORTED, *rows])


PAGE = Page("docs/explanation/diagnosis.md", {"integrity": checks_table})
