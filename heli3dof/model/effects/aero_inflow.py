"""A rotor that moves along its axis thrusts less: F → F (1 − k v_n), k in s/m.

v_n is the rotor's speed along the body's normal: with q̇ small angles aside,
v_n = L_a (cos p ṙ − cos r sin p ψ̇) ± L_h (ṗ + sin r ψ̇), + in front.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.slots import L_A, L_H, P_DOT, PSI_DOT, R_DOT, A, P, R, Stage


def thrust(s: Any, par: Any, mem: Any, out: Any) -> None:
    heave = s[L_A] * (math.cos(s[P]) * s[R_DOT] - math.cos(s[R]) * math.sin(s[P]) * s[PSI_DOT])
    tip = s[L_H] * (s[P_DOT] + math.sin(s[R]) * s[PSI_DOT])
    out[0] *= 1.0 - par[A] * (heave + tip)
    out[1] *= 1.0 - par[A] * (heave - tip)


EFFECT = Effect(
    name="aero.inflow",
    summary="Less thrust when a rotor moves along its axis: F (1 − k v_n).",
    parameters=(Parameter("loss_s_per_m", "s/m", 0.0, -1.0, 3.0, 0.2, "k"),),
    hooks={Stage.THRUST: thrust},
    order=3,
    confused_with=("friction.viscous",),
    separated_by="large",
    identifiable="quick climbs and descents while the thrust is known",
    evidence="roll_rate",
)
