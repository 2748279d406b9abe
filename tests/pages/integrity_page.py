"""The list of integrity checks in diagnosis.md, made from the checks themselves."""

from __future__ import annotations

from heli3dof.integrity import checks
from tests.pages.page import Page

NOT_IMPORTED = "`log.refused`", "a log that cannot be imported"
"""The item of the fault that the import reports before any check runs"""


def checks_list() -> str:
    """Markdown: an item for every check, in the order in which they run."""
    items = [(", ".join(f"`{n}`" for n in c.faults or (c.name,)), c.reports) for c in checks()]
    return "\n".join(f"- {names}: {reports}" for names, reports in [NOT_IMPORTED, *items])


PAGE = Page("docs/explanation/diagnosis.md", {"integrity": checks_list})
