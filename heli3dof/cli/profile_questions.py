"""Ask the user for the numbers of a new profile on the terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from heli3dof.cli.output import Output
from heli3dof.errors import UsageError

if TYPE_CHECKING:
    from pydantic.fields import FieldInfo

COMPUTED = "motor.V_o"
"""The required key that ``profile new`` computes from the masses if it is not given"""


def ask_missing(out: Output, data: dict[str, Any]) -> None:
    """Ask the user for the required keys that a profile lacks, and add the answers to ``data``.

    ``data``: the profile as nested dicts. If stdin is not a terminal, raises UsageError with the
    names of the missing keys.
    """
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.profile_file import put
    from heli3dof.toml_file import keys, value_at

    questions = [
        (name, field)
        for name, field in keys(Profile)
        if name in ("name", "encoder.roll_rest_deg") or field.is_required()
    ]
    absent = [(name, field) for name, field in questions if value_at(data, name) is None]
    missing = [name for name, field in absent if field.is_required() and name != COMPUTED]
    if not missing:
        return
    if not _is_terminal():
        raise UsageError(
            f"{len(missing)} numbers are missing: {', '.join(missing)}.",
            cause="the input is not a terminal, so heli3dof cannot ask for them.",
            fix="--set KEY=VALUE for each (heli3dof profile show lists units and a rig's values), "
            "or --from FILE",
        )
    out.err.print(
        "Enter the rig's numbers; Enter alone takes the value in brackets. Ctrl-C writes no file.",
        soft_wrap=True,
    )
    for name, field in absent:
        value = _ask(out, name, field)
        if value is not None:
            put(data, name, value)


def check_keys(given: Mapping[str, Any]) -> None:
    """Raise UsageError if ``given``, nested dicts, has a key that a profile does not have."""
    from heli3dof.errors import did_you_mean
    from heli3dof.rig.profile import Profile
    from heli3dof.toml_file import keys

    known = [name for name, _ in keys(Profile)]
    for name in _leaves(given):
        if name not in known and not name.startswith("log."):
            raise UsageError(
                f"--set {name}: a profile has no key {name!r}.",
                cause=f"a typing error; {did_you_mean(name, known)}",
                fix="heli3dof profile show lists the keys",
            )


def _leaves(given: Mapping[str, Any], head: str = "") -> Iterator[str]:
    for key, value in given.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{head}{key}.")
        else:
            yield f"{head}{key}"


def _is_terminal() -> bool:
    return sys.stdin.isatty()


def _ask(out: Output, name: str, field: FieldInfo) -> Any:
    """Ask the user for the key ``name`` until the answer is valid; return the value.

    A valid number is within the plausible range of ``field``, if it has one. A text is always
    valid. The result is None if the user omits the key.
    """
    from heli3dof.toml_file import key_of

    key = key_of(field)
    assert key is not None
    how = f"\n  How: {key.measure}." if key.measure else ""
    out.err.print(f"\n{name}: {key.meaning}{how}", soft_wrap=True)
    unit = "" if key.unit == "–" else f" in {key.unit}"
    default = None if field.is_required() else field.default
    hint = f" (common: {key.typical})" if key.typical else ""
    if name == COMPUTED:
        default, hint = "", " (Enter: from the masses)"
    while True:
        try:
            text = str(typer.prompt(f"  {name}{unit}{hint}", default=default, err=True)).strip()
        except typer.Abort:
            raise KeyboardInterrupt from None
        if field.annotation is str:
            return text
        if not text and name == COMPUTED:
            return None
        value, problem = _number(text, field)
        if not problem:
            return value
        out.err.print(f"  {problem}")


def _number(text: str, field: FieldInfo) -> tuple[Any, str]:
    """Parse ``text`` for ``field``; return (number, ""), or (None, why ``text`` is refused)."""
    from heli3dof.rig.profile_file import toml_value
    from heli3dof.toml_file import key_of, within

    value, key = toml_value(text), key_of(field)
    is_whole = field.annotation is int
    if isinstance(value, bool) or not isinstance(value, int if is_whole else (int, float)):
        return None, f"{text!r} is not a {'whole ' if is_whole else ''}number."
    if key is not None and key.plausible is not None and not within(value, key.plausible):
        low, high = key.plausible
        return None, f"Not plausible: {low:g} to {high:g} {key.unit}. {key.wrong_unit(value)}"
    return value, ""
