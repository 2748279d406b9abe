"""The table of effects in docs/effects.md, made from the catalogue.

``python -m heli3dof.diagnosis.catalogue_page docs/effects.md`` rewrites it between its markers.
"""

from __future__ import annotations

import sys
from pathlib import Path

from heli3dof.model.effects import effects
from heli3dof.model.effects.base import Effect, Parameter

BEGIN = "<!-- effects: made by python -m heli3dof.diagnosis.catalogue_page -->"
END = "<!-- end of effects -->"


def effects_table() -> str:
    """Markdown: a row for every effect that comes with heli3dof."""
    rows = [
        "| effect | axes | what it does | parameters | what shows it | confused with "
        "| separated by | drawn against |",
        "|---|---|---|---|---|---|---|---|",
    ]
    return "\n".join(rows + [_row(e) for e in effects().values()])


def _row(effect: Effect) -> str:
    cells = [
        f"`{effect.name}`",
        ", ".join(effect.axes) or "–",
        effect.summary,
        "<br>".join(_parameter(p) for p in effect.parameters),
        effect.identifiable,
        ", ".join(f"`{n}`" for n in effect.confused_with) or "–",
        f"`{effect.separated_by}`" if effect.separated_by else "–",
        effect.evidence.format(axis="the axis").replace("the axis_rate", "the axis' rate")
        .replace("_", " "),
    ]  # fmt: skip
    return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


def _parameter(p: Parameter) -> str:
    unit = "" if p.unit == "–" else f" {p.unit}"
    return f"`{p.name}`: {p.meaning}; {p.low:g} … {p.high:g}{unit}"


def with_table(page: str) -> str:
    """The page with the table between its markers made anew."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{effects_table()}\n{END}{after}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_table(path.read_text(encoding="utf-8")), encoding="utf-8")
