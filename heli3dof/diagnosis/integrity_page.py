"""The table of integrity checks in docs/diagnosis.md, made from the checks themselves.

``python -m heli3dof.diagnosis.integrity_page docs/diagnosis.md`` rewrites it between its markers.
"""

from __future__ import annotations

import sys
from pathlib import Path

from heli3dof.diagnosis.integrity import Stage, checks

BEGIN = "<!-- integrity: made by python -m heli3dof.diagnosis.integrity_page -->"
END = "<!-- end of integrity -->"
LOOKS_AT = {
    Stage.CLOCK: "the clock",
    Stage.COLUMNS: "the columns",
    Stage.VALUES: "the values",
    Stage.MOTION: "the motion",
}


def checks_table() -> str:
    """Markdown: a row for every check, in the order in which they run."""
    rows = ["| check | looks at | tells |", "|---|---|---|"]
    rows += [f"| `{c.name}` | {LOOKS_AT[c.stage]} | {c.tells} |" for c in checks()]
    return "\n".join(rows)


def with_table(page: str) -> str:
    """The page with the table between its markers made anew."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{checks_table()}\n{END}{after}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_table(path.read_text(encoding="utf-8")), encoding="utf-8")
