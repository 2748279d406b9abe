"""The table of effects in docs/reference/effects.md, made from the catalogue."""

from __future__ import annotations

from heli3dof.model.effects import effects
from heli3dof.model.effects.base import Effect, Parameter
from tests.pages.page import Page, table

INTERNAL = ("base.", "simplified.")
"""Effects that heli3dof switches on its own, and that are no causes"""
USUAL_PLAN = "large"


def effects_table() -> str:
    """Markdown: a row for every cause that comes with heli3dof."""
    head = [
        "effect", "what it does", "parameters", "motion that shows it",
        "confused with: plan that separates them",
    ]  # fmt: skip
    return table(head, [_row(e) for e in effects().values() if not e.name.startswith(INTERNAL)])


def _row(effect: Effect) -> list[str]:
    return [
        f"`{effect.name}`" + (f" ({', '.join(effect.axes)})" if effect.axes else ""),
        effect.summary,
        "<br>".join(_parameter(p) for p in effect.parameters),
        effect.identifiable,
        _confused_with(effect),
    ]


def _confused_with(effect: Effect) -> str:
    if not effect.confused_with:
        return "–"
    plan = "" if effect.separated_by == USUAL_PLAN else f": `{effect.separated_by}`"
    return ", ".join(f"`{n}`" for n in effect.confused_with) + plan


def _parameter(p: Parameter) -> str:
    return f"`{p.name}`: {p.meaning}"


PAGE = Page("docs/reference/effects.md", {"effects": effects_table})
