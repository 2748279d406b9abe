"""A product of inertia: centrifugal force moves masses below the roll axis outwards.

With P = Σ m x z in kg·m² (mass m at x along the level arm, z below it), at roll r and yaw rate ψ̇

    τ_roll = P cos 2r ψ̇²          τ_yaw = −2 P cos 2r ṙ ψ̇

Both follow from the kinetic energy ½ ψ̇² Σ m (x cos r + z sin r)². A body below the arm makes it a
pendulum (effect `stiffness.pendulum`, k = g Σ m z with gravity g) and gives P > 0. A counterweight
that hangs below reduces P. The change of the yaw inertia J_yaw by P sin 2r is neglected: a few per
cent at the angles of flight.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import PSI_DOT, R_DOT, A, R, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    c = par[A] * math.cos(2.0 * s[R])
    out[0] += c * s[PSI_DOT] * s[PSI_DOT]
    out[2] -= 2.0 * c * s[R_DOT] * s[PSI_DOT]


EFFECT = Effect(
    name="inertia.product",
    summary="Centrifugal torque of masses below the roll axis: P cos 2r ψ̇² on roll.",
    parameters=(Parameter("product_kgm2", "kg·m²", 0.0, -1.0, 1.0, 0.1, "P = Σ m x z"),),
    hooks={Stage.TORQUE: torque},
    confused_with=("stiffness.pendulum", "inertia"),
    separated_by="coast-down",
    identifiable="fast yaw, turn after turn, with roll free",
    evidence="yaw_rate",
    candidate=False,  # only many turns in yaw show it, in multi-step predictions
)
