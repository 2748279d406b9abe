"""Check an effect that a user wrote: units, equations, and the names that it refers to.

The equations run at `STATES` random states of the default rig, and must return finite numbers. With
parameters of typical size, a torque must not be zero at all states. It must be zero if each
parameter has its ``null``, the value without the effect. The last rule is not checked if a
parameter's logarithm is estimated.
"""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import RecordingError, no_file, quoted
from heli3dof.model.effects import Effect, Parameter, Stage, all_names, effects
from heli3dof.model.parameter_units import NAMED, UNITS, named_unit
from heli3dof.model.physics.compiled_effects import HookError, address
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.model.physics.state_layout import (
    AXIS,
    F_BACK,
    F_FRONT,
    K_F,
    MEMORY,
    PARAMETERS,
    PSI_DOT,
    SPEED_BACK,
    SPEED_FRONT,
    V_BACK,
    V_FRONT,
    A,
    R,
    T,
)
from heli3dof.rig.profile import default_profile

STATES = 20
"""Number of random states at which an equation runs; a torque must not be zero at every one."""
KNOWN_UNITS = {u.replace("deg", "°") for u in UNITS}
ADDED = (Stage.TORQUE, Stage.DRY)
"""Stages that add a torque"""
RUN = (*ADDED, Stage.VOLTAGE, Stage.THRUST, Stage.MEASURE)
"""Stages whose equations the check runs: not `Stage.SETUP`, which changes the rig's parameters"""


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
        exec(compile(path.read_bytes(), str(path), "exec"), module.__dict__)
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
    found += list(_unknown_names(effect, plans))
    try:
        for hook in effect.hooks.values():
            address(hook)
    except HookError as error:
        return [*found, str(error)]
    return found + list(dict.fromkeys(_equation_problems(effect)))


def unit_problems(p: Parameter) -> Iterator[str]:
    """Yield the mistakes in a parameter's unit.

    >>> list(unit_problems(Parameter("torque_Nm", "N·m·s", 0.0, -1.0, 1.0, 0.1, "")))
    ["torque_Nm: the name says Nm, the unit 'N·m·s' says Nms."]
    """
    factors = re.split(r"[·/()]", re.sub("[²³⁴]", "", p.unit))
    if unknown := [f for f in factors if f and f not in KNOWN_UNITS | {"1", "–"}]:
        yield (
            f"{p.name}: the unit {p.unit!r} contains {unknown[0]!r}. Units are products of "
            f"{', '.join(sorted(KNOWN_UNITS))}, as N·m·s²/rad², or – without a unit."
        )
        return
    named = NAMED.search(p.name)
    if named and named[1] != named_unit(p.unit):
        yield f"{p.name}: the name says {named[1]}, the unit {p.unit!r} says {named_unit(p.unit)}."


def _unknown_names(effect: Effect, plans: Collection[str]) -> Iterator[str]:
    known = {*effects(), *all_names()}
    for other in effect.confused_with:
        if other not in known:
            yield f"confused_with: there is no effect {other!r}: heli3dof effect list"
    if effect.separated_by and effect.separated_by not in plans:
        yield f"separated_by: there is no plan {effect.separated_by!r}: heli3dof plans"


def _equation_problems(effect: Effect) -> Iterator[str]:
    rig = Structure(default_profile(), ())
    rng = np.random.default_rng(0)
    null = [p.null for p in effect.parameters]
    typical = [p.typical if p.log else p.null + p.typical for p in effect.parameters]
    axis = AXES.index(effect.axes[0]) if effect.axes else -1
    for stage, hook in effect.hooks.items():
        if stage not in RUN or not effect.parameters:
            continue
        changes = []
        for _ in range(STATES):
            s = rig.arrays(rig.start)[0]
            s[T] = rng.uniform(0, 60)
            s[R : PSI_DOT + 1] = rng.normal(0, 0.5, 6)
            s[V_FRONT : V_BACK + 1] = s[SPEED_FRONT : SPEED_BACK + 1] = rng.uniform(1, 12, 2)
            s[F_FRONT : F_BACK + 1] = s[K_F] * s[V_FRONT : V_BACK + 1]
            try:
                off, on = (_change(hook, stage, s, axis, v) for v in (null, typical))
            except Exception as error:  # the code is not ours
                yield f"{stage.name}: {type(error).__name__}: {error}"
                return
            if not np.isfinite(on).all():
                yield f"{stage.name}: the equation gives a number that is not finite."
            if stage in ADDED and off.any() and not any(p.log for p in effect.parameters):
                yield (
                    f"{stage.name}: the equation adds a torque although each parameter has its "
                    "null, the value without the effect."
                )
            changes.append(on.any())
        if stage in ADDED and not any(changes):
            yield f"{stage.name}: the equation adds nothing at typical parameters."


def _change(hook: Any, stage: Stage, s: np.ndarray, axis: int, values: list[float]) -> np.ndarray:
    """Return what ``hook``, an equation of an effect, adds to its output array.

    Before the call, this array holds voltages, thrusts or angles of the state ``s``, or zeros,
    depending on ``stage``. ``values``: the effect's parameters.
    """
    begun = {Stage.VOLTAGE: s[V_FRONT : V_BACK + 1], Stage.THRUST: s[F_FRONT : F_BACK + 1],
             Stage.MEASURE: s[R : R + 3]}.get(stage, np.zeros(3))  # fmt: skip
    par, out = np.zeros(PARAMETERS), begun.copy()
    par[AXIS], par[A : A + len(values)] = axis, values
    with np.errstate(all="ignore"):
        hook(s, par, np.zeros(MEMORY), out)
    return np.asarray(out - begun)
