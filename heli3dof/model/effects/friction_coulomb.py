"""Dry friction: τ = −τ_c tanh(q̇ / ω_s), ω_s = 0.002 rad/s + 4 ms · |τ_c|/J.

The set-valued −τ_c sgn(q̇) with its step smoothed over ω_s: so narrow that a joint at rest hardly
creeps, and wide enough that a step of integration never overshoots the reversal (the friction's own
rate, τ_c/(J ω_s), stays below 250 1/s).
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.slots import AXIS, J_R, R_DOT, A, Stage

NARROWEST = 0.002
"""rad/s"""
REVERSAL_S = 0.004


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    width = NARROWEST + REVERSAL_S * abs(par[A]) / s[J_R + i]
    out[i] -= par[A] * math.tanh(s[R_DOT + i] / width)


EFFECT = Effect(
    name="friction.coulomb",
    summary="Dry friction: −τ_c sgn(q̇).",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -0.1, 1.0, 0.02, "τ_c"),),
    hooks={Stage.TORQUE: torque},
    axes=AXES,
    confused_with=("friction.viscous", "encoder.backlash"),
    separated_by="multisine",
)
