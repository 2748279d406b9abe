"""Dry friction: τ = −τ_c tanh(q̇ / ω_s), ω_s = 0.01 rad/s.

The set-valued −τ_c sgn(q̇) with its step smoothed over ω_s: slow enough for the filter to
linearise, and faster than anything but the instants of reversal. Below ω_s it creeps where the
true friction sticks.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.slots import AXIS, R_DOT, A, Stage

SMOOTHED_OVER = 0.01
"""rad/s"""


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    out[i] -= par[A] * math.tanh(s[R_DOT + i] / SMOOTHED_OVER)


EFFECT = Effect(
    name="friction.coulomb",
    summary="Dry friction: −τ_c sgn(q̇).",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -0.1, 1.0, 0.02, "τ_c"),),
    hooks={Stage.TORQUE: torque},
    axes=AXES,
    confused_with=("friction.viscous", "encoder.backlash"),
    separated_by="multisine",
)
