"""The list of keys in docs/reference/profile.md, made from the profile's own fields."""

from __future__ import annotations

from typing import TYPE_CHECKING

from heli3dof.rig.profile import Profile
from heli3dof.toml_file import Key, key_of, section_of
from tests.pages.page import Page

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo


def keys_list() -> str:
    """Markdown: an item for every key, sections in the order of the file."""
    items = [_item("", n, f) for n, f in Profile.model_fields.items() if section_of(f) is None]
    for name, field in Profile.model_fields.items():
        section = section_of(field)
        if section is not None:
            items += [_item(f"{name}.", key, f) for key, f in section.model_fields.items()]
    return "\n".join(items)


def _item(prefix: str, name: str, field: FieldInfo) -> str:
    key = key_of(field) or Key("")
    unit = "" if key.unit in {"–", "share"} else key.unit
    with_unit = unit if unit.startswith("°") else f" {unit}".rstrip()
    default = default_of(field)
    parts = [key.meaning]
    if default[0] in "-0123456789":
        parts.append(f"default {default}{with_unit}")
    elif default == "absent":
        parts.append("optional")
    elif default != "required":
        parts.append(f"default {default}")
    if key.usual is not None:
        parts.append(f"usually {key.usual[0]:g}–{key.usual[1]:g}{with_unit}")
    elif unit and unit not in parts[-1]:
        parts.append(unit)
    return f"- `{prefix}{name}`: " + "; ".join(parts)


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


PAGE = Page("docs/reference/profile.md", {"keys": keys_list})
