"""The table of effects in docs/mock.md, made from the catalogue.

``python -m heli3dof_drivers.emulator.page docs/mock.md`` rewrites it between its markers.
"""

from __future__ import annotations

import sys
from pathlib import Path

from .effects import Effect, Parameter, catalogue

BEGIN = "<!-- effects: made by python -m heli3dof_drivers.emulator.page -->"
END = "<!-- end of effects -->"


def effects_table() -> str:
    """A Markdown table: every effect with its axes, parameters, units, ranges and an example."""
    rows = [
        "| effect | axes | what it does | parameters | example |",
        "|---|---|---|---|---|",
    ]
    rows += [_row(e) for e in catalogue().values()]
    return "\n".join(rows)


def _row(effect: Effect) -> str:
    parameters = "<br>".join(_parameter(p) for p in effect.parameters)
    cells = [
        f"`{effect.name}`",
        ", ".join(effect.axes) or "–",
        effect.summary,
        parameters,
        f"`{effect.example}`",
    ]
    return "| " + " | ".join(c.replace("|", "\\|") for c in cells) + " |"


def _parameter(p: Parameter) -> str:
    default = "" if p.default is None else f", {p.default:g} if left out"
    unit = "" if p.unit == "–" else f" {p.unit}"
    return f"`{p.name}`: {p.meaning}; {p.low:g} … {p.high:g}{unit}{default}"


def with_table(page: str) -> str:
    """The page with the table between its markers made anew."""
    before, _, rest = page.partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{effects_table()}\n{END}{after}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_table(path.read_text(encoding="utf-8")), encoding="utf-8")
