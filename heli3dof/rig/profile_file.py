"""Writes profiles as commented TOML files, and edits them without losing comments.

A new file lists every key: the given keys with their values, the others commented out with their
defaults. `changed_text` edits with tomlkit, which keeps comments and order.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from heli3dof.errors import UsageError
from heli3dof.rig.profile import Profile
from heli3dof.toml_file import Section, key_of, section_of

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

TITLE = (
    "A 3-DOF helicopter's profile. docs/reference/profile.md says how to measure each number.",
    "heli3dof profile check FILE reports unusual values. A commented key has its default.",
)
SECTIONS = {
    "inertia": "of the level rig; an absent key follows from the masses",
    "limits": "outside them a flight ends, and the motors are ramped to zero",
    "log": 'columns of other programs\' logs: roll_deg = "57.2958 * x[5]"',
    "controller": "without this table the controller of an imported log is unknown",
}
HOVER_REMARK = (
    "COMPUTED from the masses, with the sign that follows from the rest angle: measure it"
)
"""Comment that marks a hover voltage ``motor.V_o`` which was not measured"""


@dataclass(frozen=True)
class Change:
    """A new value for one key of a profile, with the former value and an explaining comment."""

    key: str
    value: float | int
    before: float | int | None
    comment: str


def settings(words: Iterable[str]) -> dict[str, Any]:
    """Parse words such as ``geometry.L_a=0.66`` (value: TOML or plain text) into nested dicts.

    >>> settings(["geometry.L_a=0.66", "encoder.yaw=-8192", "name=lab 2"])
    {'geometry': {'L_a': 0.66}, 'encoder': {'yaw': -8192}, 'name': 'lab 2'}
    """
    out: dict[str, Any] = {}
    for word in words:
        name, equals, text = word.partition("=")
        if not equals or not name.strip():
            raise UsageError(
                f"--set {word} is not KEY=VALUE.",
                cause="the equals sign or the key is missing.",
                fix="--set geometry.L_a=0.66",
            )
        put(out, name.strip(), toml_value(text.strip()))
    return out


def toml_value(text: str) -> Any:
    """Return the TOML value or number that ``text`` represents, else ``text`` itself."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        pass
    try:
        return float(text)  # .25 is not TOML
    except ValueError:
        return text


def put(data: dict[str, Any], name: str, value: Any) -> None:
    *above, last = name.split(".")
    for part in above:
        inner = data.setdefault(part, {})
        if not isinstance(inner, dict):
            inner = data[part] = {}
        data = inner
    data[last] = value


def merged(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Return two nested dicts merged key by key; values of ``above`` replace those of ``below``."""
    out = dict(below)
    for name, value in above.items():
        old = out.get(name)
        both = isinstance(old, Mapping) and isinstance(value, Mapping)
        out[name] = merged(old, value) if both else value  # type: ignore[arg-type]
    return out


def new_text(data: Mapping[str, Any], remarks: Mapping[str, str] | None = None) -> str:
    """Return the text of a commented profile file.

    ``data``: the profile's values as nested dicts. ``remarks``: dotted key, e.g. ``geometry.L_a`` →
    additional comment.
    """
    remarks = remarks or {}
    lines = [f"# {line}" for line in TITLE]
    plain = {n: f for n, f in Profile.model_fields.items() if section_of(f) is None}
    for name, field in plain.items():
        lines += ["", *_entry(name, field, data.get(name), remarks.get(name))]
    for name, field in Profile.model_fields.items():
        section = section_of(field)
        if section is not None:
            lines += ["", *_section(name, section, field, data.get(name), remarks)]
    return "\n".join(lines) + "\n"


def _section(
    name: str,
    section: type[Section],
    field: FieldInfo,
    given: Mapping[str, Any] | None,
    remarks: Mapping[str, str],
) -> Iterator[str]:
    absent = given is None and field.default is None
    note = f"   # {SECTIONS[name]}" if name in SECTIONS else ""
    yield f"{'# ' if absent else ''}[{name}]{note}"
    for key, inner in section.model_fields.items():
        yield from _entry(key, inner, (given or {}).get(key), remarks.get(f"{name}.{key}"))
    for key, value in (given or {}).items():
        if key not in section.model_fields:
            yield f"{key} = {literal(value)}"


def _entry(name: str, field: FieldInfo, value: Any, remark: str | None) -> Iterator[str]:
    key = key_of(field)
    if key is not None:
        unit = "" if key.unit == "–" else f" [{key.unit}]"
        yield f"# {key.meaning}{unit}" + (f". How: {key.measure}" if key.measure else "")
    if remark:
        yield f"# {remark}"
    if value is not None:
        yield f"{name} = {literal(value)}"
    elif field.default is None:
        yield f"# {name} ="
    else:
        yield f"# {name} = {literal(field.default)}".replace("\n", "\n# ")


def literal(value: Any) -> str:
    """Return ``value`` as TOML text; a matrix gets one line for each row."""
    import tomlkit

    if isinstance(value, (list, tuple)) and value and isinstance(value[0], (list, tuple)):
        rows = [f"    {tomlkit.item(list(row)).as_string()}," for row in value]
        return "\n".join(["[", *rows, "]"])
    return str(tomlkit.item(list(value) if isinstance(value, tuple) else value).as_string())


def changed_text(text: str, changes: Iterable[Change]) -> str:
    """Return the TOML file ``text`` with ``changes`` made; all other lines stay as they are.

    A changed ``motor.V_o`` loses its mark `HOVER_REMARK`.
    """
    import tomlkit

    changes = list(changes)
    if any(change.key == "motor.V_o" for change in changes):
        text = text.replace(f"# {HOVER_REMARK}\n", "")
    document: Any = tomlkit.parse(text)
    for change in changes:
        *above, last = change.key.split(".")
        table = document
        for part in above:
            if part not in table:
                table[part] = tomlkit.table()
            table = table[part]
        item = tomlkit.item(change.value)
        item.comment(change.comment)
        table[last] = item
    return tomlkit.dumps(document)
