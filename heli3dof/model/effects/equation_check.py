"""Check an effect's equations for mistakes, such as a wrong index or a result that is not finite.

The equations are evaluated at several states within the default rig's limits. `equation_mistakes`
returns a message per mistake. The equations run in Python, on arrays that raise an error at a wrong
index. Compiled code does not check an index, and would read or change other memory.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect
from heli3dof.model.physics.state_layout import (
    AXIS,
    F_BACK,
    F_FRONT,
    K_F,
    MEMORY,
    PARAMETERS,
    R_DOT,
    SPEED_BACK,
    SPEED_FRONT,
    V_BACK,
    V_FRONT,
    A,
    R,
    Stage,
    T,
    context,
)
from heli3dof.rig.profile import default_profile

STATES = 20
"""Number of states at which an equation runs: the rig at rest, and random ones"""
LAST_S = 60.0
"""s, latest time of a state: the length of a usual flight (a convention)"""
ADDED = (Stage.TORQUE, Stage.DRY)
"""Stages whose equations add to ``out``"""
PER_AXIS = (*ADDED, Stage.MEASURE)
"""Stages in which ``out`` has one element per axis"""
CHANGED = {
    Stage.VOLTAGE: slice(V_FRONT, V_BACK + 1),
    Stage.THRUST: slice(F_FRONT, F_BACK + 1),
    Stage.MEASURE: slice(R, R + 3),
}
"""Stage → the elements of the state that ``out`` contains before the equation changes it"""


def states() -> Iterator[np.ndarray]:
    """Yield `STATES` states of the default rig, each as a read-only array (SIZE,).

    In the first state, the rig is at rest. The other states are random, within the rig's limits.
    """
    rng = np.random.default_rng(0)
    profile = default_profile()
    limits, v_max = profile.limits, profile.motor.v_max
    high = np.radians([limits.roll_max_deg, limits.pitch_max_deg, limits.yaw_max_deg])
    low = -high
    low[0] = np.radians(limits.roll_min_deg)
    rate = np.radians([getattr(limits, f"{axis}_rate_max_deg_per_s") for axis in AXES])
    for i in range(STATES):
        s = context(profile)
        volts = np.full(2, profile.motor.V_o)
        if i > 0:
            s[T] = rng.uniform(0, LAST_S)
            s[R : R + 3] = rng.uniform(low, high)
            s[R_DOT : R_DOT + 3] = rng.uniform(-rate, rate)
            volts = rng.uniform(-v_max, v_max, 2)
        s[V_FRONT : V_BACK + 1] = s[SPEED_FRONT : SPEED_BACK + 1] = volts
        s[F_FRONT : F_BACK + 1] = s[K_F] * volts
        s.flags.writeable = False
        yield s


def equation_mistakes(effect: Effect) -> list[str]:
    """Return a sentence per mistake that would change the results of other effects.

    An equation must raise no exception, not change its arguments other than ``mem`` and ``out``,
    and return finite numbers. It may change only the axis on which it acts. It must add to a torque
    instead of replacing it. It must add no torque if all parameters have their ``null`` values, at
    which the effect is absent. This last rule is not checked in two cases: if the effect has no
    parameters, or if the logarithm of a parameter is estimated (``log``).
    """
    axes = [AXES.index(axis) for axis in effect.axes] or [-1]
    found = (m for stage in effect.hooks for axis in axes for m in _mistakes(effect, stage, axis))
    return list(dict.fromkeys(found))


def adds_nothing(effect: Effect, stage: Stage) -> bool:
    """Return True if the equation adds zero to its torque in all `states`.

    The parameters have `typical` values. The function tries only the first of the effect's axes.
    """
    axis = AXES.index(effect.axes[0]) if effect.axes else -1
    run = _equation(effect, stage, axis, typical(effect))
    return not any(run(s, np.zeros(3)).any() for s in states())


def typical(effect: Effect) -> list[float]:
    """Return for each parameter a value at which the effect is noticeable: ``null`` + ``typical``.

    ``null`` is the value without the effect, ``typical`` a noticeable deviation from it. If the
    parameter's logarithm is estimated (``log``), the value is ``typical`` alone.
    """
    return [p.typical if p.log else p.null + p.typical for p in effect.parameters]


def _mistakes(effect: Effect, stage: Stage, axis: int) -> Iterator[str]:
    null = [p.null for p in effect.parameters]
    has_null = bool(null) and not any(p.log for p in effect.parameters)
    off, on, on_zeros = (
        _equation(effect, stage, axis, v) for v in (null, typical(effect), typical(effect))
    )
    others = [i for i in range(3) if i != axis] if stage in PER_AXIS and axis >= 0 else []
    for i, s in enumerate(states()):
        where = "at roll {:.2g}, pitch {:.2g}, yaw {:.2g} rad".format(*s[R:]) if i else "at rest"
        before = s if stage is Stage.SETUP else s[CHANGED.get(stage, slice(R, R + 3))]
        try:
            now = on(s, before)
            if not np.isfinite(now).all():
                yield f"{stage.name}: the equation gives a number that is not finite {where}."
                return
            if now[others].any():
                yield (
                    f"{stage.name}: the equation of {AXES[axis]} changes "
                    f"{AXES[next(k for k in others if now[k])]}; index out by par[AXIS], or "
                    "correct axes."
                )
            if stage not in ADDED:
                continue
            if not np.allclose(now, on_zeros(s, np.zeros(3))):
                yield f"{stage.name}: the equation replaces out; add to it (out[…] += …)."
            elif has_null and off(s, before).any():
                yield (
                    f"{stage.name}: the equation adds a torque although each parameter has its "
                    "null, the value without the effect."
                )
        except Exception as error:  # the code is not ours
            yield f"{stage.name}: {type(error).__name__} {where}: {error}."
            return


def _equation(
    effect: Effect, stage: Stage, axis: int, values: list[float]
) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return a function ``change(s, before)`` that runs the effect's equation at the state ``s``.

    An equation modifies an array, for example the torques. ``before`` is this array before the
    equation runs; ``change`` returns its modification. ``values`` are the effect's parameters. An
    equation with hysteresis keeps its internal state from one call of ``change`` to the next.
    """
    par, memory = np.zeros(PARAMETERS), _Pointer(np.zeros(MEMORY))
    par[AXIS], par[A : A + len(values)] = axis, values
    par.flags.writeable = False

    def change(s: np.ndarray, before: np.ndarray) -> np.ndarray:
        out = before.copy()
        with np.errstate(all="ignore"):
            effect.hooks[stage](_Pointer(s), _Pointer(par), memory, _Pointer(out))
        return np.asarray(out - before)

    return change


class _Pointer:
    """An array as compiled equations see it, but with an IndexError for an index outside it."""

    def __init__(self, values: np.ndarray) -> None:
        self._values = values

    def __getitem__(self, index: Any) -> Any:
        return self._values[self._inside(index)]

    def __setitem__(self, index: Any, value: Any) -> None:
        self._values[self._inside(index)] = value

    def _inside(self, index: Any) -> int:
        if not 0 <= index < len(self._values):
            raise IndexError(f"index {index} is outside the array, which is 0 … "
                             f"{len(self._values) - 1}")  # fmt: skip
        return int(index)
