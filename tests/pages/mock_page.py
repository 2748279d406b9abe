"""The lists of effects, faults and bus in docs/reference/mock.md, made from the catalogues."""

from __future__ import annotations

from heli3dof_drivers.emulator.effects import Effect, Parameter, catalogue
from heli3dof_drivers.emulator.faults import KINDS
from heli3dof_drivers.emulator.transport_usb import KINDS as BUS

from heli3dof.model.effects import effects
from tests.pages.page import Page


def effects_table() -> str:
    """A Markdown list: every effect by an example, with the names of its parameters."""
    return "\n".join(_item(e) for e in catalogue().values())


def _item(effect: Effect) -> str:
    """An effect that the models do not have is described here, since effects.md omits it."""
    values = ", ".join(_parameter(p) for p in effect.parameters)
    own = "" if effect.name in effects() else f". {effect.summary}"
    return f"- `{effect.example}`: {values}{own}"


def _parameter(p: Parameter) -> str:
    default = "" if p.default is None else f" (default {p.default:g})"
    return f"`{p.name}`{default}"


def faults_table() -> str:
    """A Markdown list: every fault with an example."""
    return "\n".join(f"- `{example}`: {what}" for example, what in KINDS.values())


def bus_table() -> str:
    """A Markdown list: every fault of a USB rig, with an example."""
    return "\n".join(f"- `{example}`: {what}" for example, what in BUS.values())


PAGE = Page(
    "docs/reference/mock.md",
    {"effects": effects_table, "faults": faults_table, "bus": bus_table},
)
