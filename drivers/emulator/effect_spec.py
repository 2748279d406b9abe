"""Parses the URL option ``hide=``: effects as ``name[.axis]:value[@value]``, separated by commas.

The values are the effect's parameters, e.g. size and start time. The option may be repeated.
Example: ``hide=friction.coulomb.yaw:0.03,mass.change:0.05@20``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from heli3dof.axes import ALIASES, AXES
from heli3dof.errors import UsageError, did_you_mean

from .effects import Effect, Hidden, catalogue


def parse_hide(texts: Iterable[str]) -> tuple[Hidden, ...]:
    """Return the effects in ``texts``, values of ``hide=``, in the order in which they act.

    Raises UsageError for an unknown effect or axis (naming the nearest), for a repeated effect, and
    for a missing, superfluous or out-of-range value.
    """
    hidden: list[Hidden] = []
    for text in texts:
        for part in filter(None, (p.strip() for p in text.split(","))):
            one = _parse_one(part)
            if any(h.effect is one.effect and h.axis == one.axis for h in hidden):
                raise UsageError(
                    f"hide={part}: this effect is hidden twice.",
                    cause="hide= names the same effect more than once.",
                    fix="give it once, with the sum of both values",
                )
            hidden.append(one)
    return tuple(sorted(hidden, key=lambda h: h.effect.order))


def _parse_one(text: str) -> Hidden:
    name, _, values = text.partition(":")
    known = catalogue()
    if name == "geometry":
        raise UsageError(
            "hide=geometry: the emulated rig cannot hide its geometry.",
            cause="it is always the full nonlinear rigid body; geometry is what the linear hover "
            "model lacks.",
            fix="omit it; large steps show it: heli3dof run large",
        )
    effect, axis_name = known.get(name), ""
    if effect is None and "." in name:
        stem, _, axis_name = name.rpartition(".")
        effect = known.get(stem)
    if effect is None:
        raise UsageError(
            f"hide={text}: the emulated rig does not simulate an effect {name!r}.",
            cause="only the models have it (heli3dof effect list shows theirs), or a typing error; "
            f"{did_you_mean(name, _names(known.values()))}",
            fix="docs/reference/mock.md lists every effect with its unit and an example",
        )
    return Hidden(effect, _axis(effect, axis_name, text), values_of(effect, values, text))


def _names(effects: Iterable[Effect]) -> list[str]:
    return [f"{e.name}.{a}" if a else e.name for e in effects for a in (e.axes or ("",))]


def _axis(effect: Effect, name: str, text: str) -> int:
    if not effect.axes:
        if name:
            raise UsageError(
                f"hide={text}: {effect.name} has no axis.",
                cause=f"{name!r} is not part of its name.",
                fix=f"hide={effect.example}",
            )
        return -1
    name = ALIASES.get(name, name)
    if name not in effect.axes:
        problem = f"there is no axis {name!r} for" if name else "an axis is missing after"
        raise UsageError(
            f"hide={text}: {problem} {effect.name}.",
            cause=f"it acts on one axis; {did_you_mean(name, effect.axes)}",
            fix=f"hide={effect.example}",
        )
    return AXES.index(name)


def values_of(effect: Effect, text: str, whole: str) -> tuple[float, ...]:
    """Return the parameters in ``text``, such as ``0.05@20``; ``whole``: the text for messages."""
    given = text.split("@") if text else []
    form = "@".join(p.name for p in effect.parameters)
    if len(given) > len(effect.parameters):
        raise UsageError(
            f"hide={whole}: {len(given)} values for {effect.name}, which has "
            f"{len(effect.parameters)}.",
            cause=f"the values are {form}; a comma separates effects.",
            fix=f"hide={effect.example}",
        )
    values: list[float] = []
    for i, parameter in enumerate(effect.parameters):
        label = f"{parameter.name} ({parameter.unit})"
        if i >= len(given):
            if parameter.default is None:
                raise UsageError(
                    f"hide={whole}: the value of {label} is missing.",
                    cause="every effect needs its size, after a colon.",
                    fix=f"hide={effect.example}",
                )
            values.append(parameter.default)
            continue
        try:
            value = float(given[i])
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise UsageError(
                f"hide={whole}: {given[i]!r} is not a number for {label}.",
                cause=f"the values are {form}, numbers without names or units.",
                fix=f"hide={effect.example}",
            )
        if not parameter.low <= value <= parameter.high:
            raise UsageError(
                f"hide={whole}: {label} = {value:g} lies outside "
                f"{parameter.low:g} … {parameter.high:g}.",
                cause="another unit, or a value that is impossible for a rig of this size.",
                fix=f"hide={effect.example}",
            )
        values.append(value)
    return tuple(values)
