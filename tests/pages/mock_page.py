"""The tables of effects, faults and bus in docs/reference/mock.md, made from the catalogues."""

from __future__ import annotations

from heli3dof_drivers.emulator.effects import Effect, Parameter, catalogue
from heli3dof_drivers.emulator.faults import KINDS
from heli3dof_drivers.emulator.transport_usb import KINDS as BUS

from tests.pages.page import Page, table


def effects_table() -> str:
    """A Markdown table: every effect with its axes, parameters, units, ranges and an example."""
    head = ["effect", "axes", "what it does", "parameters", "example"]
    return table(head, [_row(e) for e in catalogue().values()])


def _row(effect: Effect) -> list[str]:
    return [
        f"`{effect.name}`",
        ", ".join(effect.axes) or "–",
        effect.summary,
        "<br>".join(_parameter(p) for p in effect.parameters),
        f"`{effect.example}`",
    ]


def _parameter(p: Parameter) -> str:
    default = "" if p.default is None else f", {p.default:g} if left out"
    unit = "" if p.unit == "–" else f" {p.unit}"
    return f"`{p.name}`: {p.meaning}; {p.low:g} … {p.high:g}{unit}{default}"


def faults_table() -> str:
    """A Markdown table: every fault with an example."""
    return table(["fault", "what breaks"], [[f"`{e}`", what] for e, what in KINDS.values()])


def bus_table() -> str:
    """A Markdown table: every fault of a USB rig, with an example."""
    return table(["bus", "what befalls the rig"], [[f"`{e}`", what] for e, what in BUS.values()])


PAGE = Page(
    "docs/reference/mock.md",
    {"effects": effects_table, "faults": faults_table, "bus": bus_table},
)
