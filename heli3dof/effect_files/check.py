"""Check an effect that a user wrote: units, equations, and the names that it refers to.

`heli3dof.model.effects.equation_check` runs the equations. It does so in this check, and again each
time that heli3dof loads a plug-in. This check has one more condition: with parameters of typical
size, a torque must differ from zero in at least one state.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Collection, Iterator
from pathlib import Path

from heli3dof.effect_names import name_mistake
from heli3dof.errors import RecordingError, quoted
from heli3dof.file_kind import no_file
from heli3dof.model.effects import Effect, Parameter, all_names, effects, plug_ins
from heli3dof.model.effects.empirical import empirical_effect
from heli3dof.model.effects.equation_check import ADDED, adds_nothing, equation_mistakes
from heli3dof.model.parameter_units import NAMED, SUPERSCRIPTS, UNITS, named_unit
from heli3dof.model.physics.compiled_effects import address
from heli3dof.plugins import CodeError

KNOWN_UNITS = {u.replace("deg", "°") for u in UNITS}


def effect_of_file(path: Path) -> Effect:
    """Run a Python file and return its ``EFFECT``.

    Raises UsageError if there is no such file, RecordingError if it has no effect.
    """
    if not path.is_file():
        raise no_file(path)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise RecordingError(
            f"{path} is not a Python file.",
            cause="an effect is a file of Python code, NAME.py.",
            fix="heli3dof effect new NAME",
        )
    module = importlib.util.module_from_spec(spec)
    try:
        # The loader would run old byte code after a change within a second that keeps the length.
        exec(compile(path.read_bytes(), str(path.resolve()), "exec"), module.__dict__)
    except (Exception, SystemExit) as error:
        raise RecordingError(
            f"{path} does not load: {type(error).__name__}: {error}",
            cause="a mistake in the file's code, which the message names.",
            fix=f"correct it, then: heli3dof effect check {quoted(path)}",
        ) from error
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise RecordingError(
            f"{path} has no EFFECT = Effect(…).",
            cause="another file of the package contains it, or it has another name.",
            fix="heli3dof effect new NAME writes a file to begin with",
        )
    return effect


def problems(effect: Effect, plans: Collection[str]) -> list[str]:
    """Return a sentence per mistake in an effect; ``plans``: names of the existing plans."""
    found = [s for p in effect.parameters for s in unit_problems(p)]
    found += list(_wrong_names(effect, plans))
    try:
        for hook in effect.hooks.values():
            address(hook)
    except CodeError as error:
        return [*found, str(error)]
    if mistakes := equation_mistakes(effect):
        return found + mistakes
    return found + [
        f"{stage.name}: the equation adds nothing at typical parameters."
        for stage in effect.hooks
        if stage in ADDED and effect.parameters and adds_nothing(effect, stage)
    ]


def unit_problems(p: Parameter) -> Iterator[str]:
    """Yield the mistakes in a parameter's unit.

    >>> list(unit_problems(Parameter("torque_Nm", "N·m·s", 0.0, -1.0, 1.0, 0.1, "")))
    ["torque_Nm: the name says Nm, the unit 'N·m·s' says Nms."]
    """
    factors = re.split(r"[·/()]", re.sub(f"[{SUPERSCRIPTS}]+", "", p.unit))
    if unknown := [f for f in factors if f and f not in KNOWN_UNITS | {"1", "–"}]:
        yield (
            f"{p.name}: the unit {p.unit!r} contains {unknown[0]!r}. Units are products of "
            f"{', '.join(sorted(KNOWN_UNITS))}, as N·m·s²/rad², or – without a unit."
        )
        return
    named = NAMED.search(p.name)
    if named and named[1] != named_unit(p.unit):
        yield f"{p.name}: the name says {named[1]}, the unit {p.unit!r} says {named_unit(p.unit)}."


def _wrong_names(effect: Effect, plans: Collection[str]) -> Iterator[str]:
    same = effects().get(effect.name) or empirical_effect(effect.name)
    if not same and (mistake := name_mistake(effect.name)):
        yield f"name: {mistake}"
    if same and same.name not in plug_ins() and _files(same) != _files(effect):
        yield f"name: heli3dof has an effect {effect.name!r} already; choose another name."
    known = {*effects(), *all_names()}
    for other in effect.confused_with:
        if other not in known:
            yield f"confused_with: there is no effect {other!r}: heli3dof effect list"
    for key, other in (("within", effect.within), ("requires", effect.requires)):
        if other and other not in all_names():
            yield (
                f"{key}: {other!r} is not the name of an effect, with the axis if it has one: "
                "heli3dof effect list"
            )
    if effect.separated_by and effect.separated_by not in plans:
        yield f"separated_by: there is no plan {effect.separated_by!r}: heli3dof plans"


def _files(effect: Effect) -> set[str]:
    """Return the paths of the files that contain an effect's equations."""
    return {hook.__code__.co_filename for hook in effect.hooks.values()}
