"""Gyroscopic torques of the propellers, angular momentum H = k (Ω_f + Ω_b) along the normal n.

The couple on a body that turns at ω is −ω × H n. With ω's components along arm (a) and bar (b),
ω_a = ṗ + sin r ψ̇ and ω_b = −cos p ṙ + cos r sin p ψ̇, it is (−H ω_b, H ω_a) along (a, b), so by
virtual work τ_roll = −cos p H ω_a, τ_pitch = −H ω_b, τ_yaw = H (cos r sin p ω_a − sin r ω_b). It
does no work. Ω are the rotors' speeds as their steady-state voltages in V, k in N·m·s/V.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import (
    P_DOT,
    PSI_DOT,
    R_DOT,
    SPEED_BACK,
    SPEED_FRONT,
    A,
    P,
    R,
    Stage,
)


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    H = par[A] * (s[SPEED_FRONT] + s[SPEED_BACK])
    sr, cr = math.sin(s[R]), math.cos(s[R])
    sp, cp = math.sin(s[P]), math.cos(s[P])
    about_a = s[P_DOT] + sr * s[PSI_DOT]
    about_b = -cp * s[R_DOT] + cr * sp * s[PSI_DOT]
    along_a, along_b = -H * about_b, H * about_a
    out[0] += -cp * along_b
    out[1] += along_a
    out[2] += sr * along_a + cr * sp * along_b


EFFECT = Effect(
    name="aero.gyroscopic",
    summary="The propellers' angular momentum resists being turned: −ω × H.",
    parameters=(Parameter("momentum_Nms_per_V", "N·m·s/V", 0.0, -0.05, 0.05, 0.001, "k"),),
    hooks={Stage.TORQUE: torque},
    separated_by="large",
    identifiable="fast pitch and roll together: their torques cross over",
    evidence="pitch_rate",
)
