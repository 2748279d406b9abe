"""The tables in plans.md: the plans that come with heli3dof, and every key of a plan."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from heli3dof.experiment.plan import Head, load_plan, named_plans
from heli3dof.experiment.segments import BaseSegment, kinds
from heli3dof.toml_file import Key, key_of
from tests.pages.page import Page, table
from tests.pages.profile_page import default_of

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

HEAD = ("key", "unit", "default", "what it is")


def plans_table() -> str:
    """Markdown: every plan that comes with heli3dof."""
    rows = []
    for name in named_plans():
        plan = load_plan(name)
        rows.append([f"`{name}`", f"{plan.duration_s:g} s", plan.description, plan.purpose])
    return table(("plan", "duration", "what it flies", "good for"), rows)


def head_table() -> str:
    """Markdown: the keys of a plan."""
    return table(HEAD, [_row(n, f) for n, f in Head.model_fields.items()])


def common_table() -> str:
    """Markdown: the keys that every segment has."""
    return table(HEAD, [_row(n, f) for n, f in BaseSegment.model_fields.items()])


def kinds_text() -> str:
    """Markdown: each kind of segment, what it does, and the keys of its own."""
    parts = []
    for kind, segment in sorted(kinds().items()):
        summary = (importlib.import_module(segment.__module__).__doc__ or "").splitlines()[0]
        own = [
            _row(n, f) for n, f in segment.model_fields.items() if n not in BaseSegment.model_fields
        ]
        keys = table(HEAD, own) if own else "No keys of its own."
        parts.append(f"### `{kind}`\n\n{_sentence(summary)}\n\n{keys}")
    return "\n\n".join(parts)


def _sentence(first_line: str) -> str:
    text = first_line.partition(":")[2].strip()
    return text[:1].upper() + text[1:]


def _row(name: str, field: FieldInfo) -> list[str]:
    key = key_of(field) or Key("")
    return [f"`{name}`", key.unit, default_of(field), key.meaning]


PAGE = Page(
    "docs/reference/plans.md",
    {"plans": plans_table, "head": head_table, "common": common_table, "kinds": kinds_text},
)
