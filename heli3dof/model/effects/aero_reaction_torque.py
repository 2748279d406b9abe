"""Reaction torque of the propellers about the body's normal: κF, with F = F_f + F_b.

F_f and F_b are the front and back thrust (N). κ (m) is the ratio of torque to thrust; r, p, ψ are
roll, pitch, yaw. ω_n is the angular velocity about the normal. The couple κF along the normal has
the power κF ω_n = κF (sin p ṙ + cos r cos p ψ̇). So τ_roll = κF sin p and τ_yaw = κF cos r cos p.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import F_BACK, F_FRONT, A, P, R, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    couple = par[A] * (s[F_FRONT] + s[F_BACK])
    out[0] += couple * math.sin(s[P])
    out[2] += couple * math.cos(s[R]) * math.cos(s[P])


EFFECT = Effect(
    name="aero.reaction_torque",
    summary="The propellers twist the body about its normal by κF.",
    parameters=(Parameter("torque_per_thrust_m", "m", 0.0, -0.3, 0.3, 0.02, "κ"),),
    hooks={Stage.TORQUE: torque},
    confused_with=("bias.torque.yaw", "encoder.offset.pitch"),
    separated_by="large",
    identifiable="several common voltages: the torque on yaw grows with the thrust",
    evidence="voltage_sum",
)
