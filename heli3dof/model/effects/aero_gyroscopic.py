"""Gyroscopic torques of the propellers, whose angular momentum is H = k (Ω_f + Ω_b).

H points along the body's normal n. Ω_f, Ω_b are the rotors' speeds, expressed as the voltages (V)
that cause them in steady state; k in N·m·s/V. At the angular velocity ω the body gets the couple
−ω×H n. Let a be the arm's direction, b that of the bar that carries the motors. With roll r, pitch
p, yaw ψ, ω has the components

    ω_a = ṗ + sin r ψ̇             ω_b = −cos p ṙ + cos r sin p ψ̇

so the couple along a, b is (−H ω_b, H ω_a). It does no work on the body. By virtual work,

    τ_roll = −cos p H ω_a,  τ_pitch = −H ω_b,  τ_yaw = H (cos r sin p ω_a − sin r ω_b)
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
