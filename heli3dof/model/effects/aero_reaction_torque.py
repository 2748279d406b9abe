"""Reaction torque of the propellers about the body's normal: M = κ F_h Σ sgn(F_i) |F_i/F_h|ⁿ.

F_i is the thrust (N) of the front and the back rotor, F_h a rotor's thrust at hover. κ (m) is the
ratio of torque to thrust at hover; r, p, ψ are roll, pitch, yaw. ω_n is the angular velocity about
the normal. The couple M along the normal has the power M ω_n = M (sin p ṙ + cos r cos p ψ̇). So
τ_roll = M sin p and τ_yaw = M cos r cos p.

* n = 1: the torque is proportional to the thrust.
* n = 2: the torque grows with V² although the model's thrust is linear in the voltage V.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import F_BACK, F_FRONT, K_F, V_O, A, B, P, R, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    hover = s[K_F] * abs(s[V_O])
    front = math.copysign((abs(s[F_FRONT]) / hover) ** par[B], s[F_FRONT])
    back = math.copysign((abs(s[F_BACK]) / hover) ** par[B], s[F_BACK])
    couple = par[A] * hover * (front + back)
    out[0] += couple * math.sin(s[P])
    out[2] += couple * math.cos(s[R]) * math.cos(s[P])


EFFECT = Effect(
    name="aero.reaction_torque",
    summary="The propellers twist the body about its normal by κ F_h Σ sgn(F) |F/F_h|ⁿ.",
    parameters=(
        Parameter("torque_per_thrust_m", "m", 0.0, -0.3, 0.3, 0.02, "κ"),
        Parameter("exponent", "–", 1.0, 0.5, 3.5, 0.3, "n", prior_std=0.5),
    ),
    hooks={Stage.TORQUE: torque},
    confused_with=("bias.torque.yaw", "encoder.offset.pitch"),
    separated_by="large",
    identifiable="several common voltages: the torque on yaw grows with the thrust",
    evidence="voltage_sum",
)
