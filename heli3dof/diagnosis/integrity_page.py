"""The table of integrity checks in docs/diagnosis.md, made from the checks themselves.

``python -m heli3dof.diagnosis.integrity_page docs/diagnosis.md`` rewrites it between its markers.
"""

from __future__ import annotations

from heli3dof.diagnosis.integrity import Stage, checks
from heli3dof.pages import Page, table

STAGES = {
    Stage.CLOCK: "the clock",
    Stage.COLUMNS: "the columns",
    Stage.VALUES: "the values",
    Stage.MOTION: "the motion",
}


def checks_table() -> str:
    """Markdown: a row for every check, in the order in which they run."""
    rows = [[f"`{c.name}`", STAGES[c.stage], c.tells] for c in checks()]
    return table(["check", "stage", "finds"], rows)


PAGE = Page("heli3dof.diagnosis.integrity_page", {"integrity": checks_table})

if __name__ == "__main__":
    PAGE.main()
