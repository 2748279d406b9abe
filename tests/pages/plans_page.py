"""The table and lists in plans.md: the plans that come with heli3dof, and every key of a plan."""

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


def plans_table() -> str:
    """Markdown: every plan that comes with heli3dof."""
    rows = []
    for name in named_plans():
        plan = load_plan(name)
        flown = plan.description.removeprefix("take-off, then ")
        rows.append([f"`{name}`", f"{plan.duration_s:g} s", flown, plan.purpose])
    return table(("plan", "duration", "what it flies after take-off", "good for"), rows)


def head_keys() -> str:
    """Markdown: the keys of a plan."""
    return "\n".join(_item(n, f) for n, f in Head.model_fields.items())


def common_keys() -> str:
    """Markdown: the keys that every segment has."""
    return "\n".join(_item(n, f) for n, f in BaseSegment.model_fields.items())


def kinds_text() -> str:
    """Markdown: each kind of segment, what it does, and the keys of its own."""
    parts = []
    for kind, segment in sorted(kinds().items()):
        summary = (importlib.import_module(segment.__module__).__doc__ or "").splitlines()[0]
        own = [
            _item(n, f)
            for n, f in segment.model_fields.items()
            if n not in BaseSegment.model_fields
        ]
        keys = "\n".join(own) or "No keys of its own."
        parts.append(f"### `{kind}`\n\n{_sentence(summary)}\n\n{keys}")
    return "\n\n".join(parts)


def _sentence(first_line: str) -> str:
    text = first_line.partition(":")[2].strip()
    return text[:1].upper() + text[1:]


def _item(name: str, field: FieldInfo) -> str:
    key = key_of(field) or Key("")
    default = default_of(field)
    if default[0] in "-0123456789":
        default = f"default {default} {'' if key.unit == '–' else key.unit}".strip()
    elif default != "required":
        default = "optional"
    return f"- `{name}`: {key.meaning}; {default}"


PAGE = Page(
    "docs/reference/plans.md",
    {"plans": plans_table, "head": head_keys, "common": common_keys, "kinds": kinds_text},
)
