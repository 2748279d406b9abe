"""The tables of keys in docs/reference/profile.md, made from the profile's own fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.rig.profile import Profile
from heli3dof.toml_file import Key, Section, key_of, section_of
from tests.pages.page import Page, table

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

HEAD = ("key", "unit", "default", "what it is", "how to measure or choose it", "usual", "accepted")


def keys_table() -> str:
    """Markdown: a row for every key, sections in the order of the file."""
    rows = [_row("", n, f) for n, f in Profile.model_fields.items() if section_of(f) is None]
    for name, field in Profile.model_fields.items():
        section = section_of(field)
        if section is not None:
            rows += _rows(name, section)
    return table(HEAD, rows)


def _rows(name: str, section: type[Section]) -> list[list[str]]:
    return [_row(f"{name}.", key, field) for key, field in section.model_fields.items()]


def _row(prefix: str, name: str, field: FieldInfo) -> list[str]:
    key = key_of(field) or Key("")
    return [
        f"`{prefix}{name}`",
        key.unit,
        default_of(field),
        key.meaning,
        key.measure or "–",
        _range(key.usual),
        _range(key.plausible),
    ]


def default_of(field: FieldInfo) -> str:
    """The default as a reader wants it: required, computed, or the value."""
    if field.is_required():
        return "required"
    if field.default is None:
        return "absent"
    if isinstance(field.default, tuple) and isinstance(field.default[0], tuple):
        return "the paper's K_g"
    if isinstance(field.default, tuple):
        return " … ".join(f"{x:g}" for x in field.default)
    if isinstance(field.default, float):
        return f"{field.default:g}"
    return f"`{field.default}`" if field.default else "empty"


def _range(bounds: tuple[float, float] | None) -> str:
    return "any" if bounds is None else f"{bounds[0]:g} … {bounds[1]:g}"


PAGE = Page("docs/reference/profile.md", {"keys": keys_table})
