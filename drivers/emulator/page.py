"""The tables of effects, faults and bus in docs/mock.md, made from what there is.

``python -m heli3dof_drivers.emulator.page docs/mock.md`` rewrites them between their markers.
"""

from __future__ import annotations

import sys
from pathlib import Path

from .door_usb import KINDS as BUS
from .effects import Effect, Parameter, catalogue
from .faults import KINDS


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


def faults_table() -> str:
    """A Markdown table: every fault with an example."""
    rows = ["| fault | what breaks |", "|---|---|"]
    return "\n".join([*rows, *(f"| `{example}` | {what} |" for example, what in KINDS.values())])


def bus_table() -> str:
    """A Markdown table: everything that may befall a USB rig, with an example."""
    rows = ["| bus | what befalls the rig |", "|---|---|"]
    return "\n".join([*rows, *(f"| `{example}` | {what} |" for example, what in BUS.values())])


TABLES = {"effects": effects_table, "faults": faults_table, "bus": bus_table}


def with_tables(page: str) -> str:
    """The page with the tables between their markers made anew."""
    for name, table in TABLES.items():
        begin = f"<!-- {name}: made by python -m heli3dof_drivers.emulator.page -->"
        end = f"<!-- end of {name} -->"
        before, _, rest = page.partition(begin)
        _, _, after = rest.partition(end)
        page = f"{before}{begin}\n{table()}\n{end}{after}"
    return page


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_tables(path.read_text(encoding="utf-8")), encoding="utf-8")
