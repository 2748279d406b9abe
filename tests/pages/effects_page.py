"""The table of effects in docs/reference/effects.md, made from the catalogue."""

from __future__ import annotations

from heli3dof.model.effects import effects
from heli3dof.model.effects.base import Effect, Parameter
from tests.pages.page import Page, table


def effects_table() -> str:
    """Markdown: a row for every effect that comes with heli3dof."""
    head = [
        "effect", "axes", "what it does", "parameters", "what shows it", "confused with",
        "separated by", "drawn against",
    ]  # fmt: skip
    return table(head, [_row(e) for e in effects().values()])


def _row(effect: Effect) -> list[str]:
    return [
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


def _parameter(p: Parameter) -> str:
    unit = "" if p.unit == "–" else f" {p.unit}"
    return f"`{p.name}`: {p.meaning}; {p.low:g} … {p.high:g}{unit}"


PAGE = Page("docs/reference/effects.md", {"effects": effects_table})
