"""A rotor that moves in its thrust's direction thrusts less: F → F − k F_h |F/F_h|ⁿ v_n.

F is a rotor's thrust (N), F_h its thrust at hover. k (s/m) and n are the parameters of the effect.
v_n (m/s) is the rotor's speed along the body's normal, the direction of positive thrust:

    v_n = L_a (cos p ṙ − cos r sin p ψ̇) ± L_h (ṗ + sin r ψ̇)         (+ front rotor, − back rotor)

r, p, ψ are roll, pitch, yaw; L_a is the distance from yaw axis to body, L_h from body to rotor (m).
At hover the loss is k F_h v_n for every n.

* n = 1: the loss is proportional to the thrust: F → F (1 − k v_n).
* n = 1/2: the loss is proportional to the rotor's speed Ω, with F ∝ Ω², as for a propeller.
* n = 0: the loss does not depend on the thrust. On a level rig it equals viscous friction on roll
  and pitch with coefficients in the ratio (L_a/L_h)².
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import (
    K_F,
    L_A,
    L_H,
    P_DOT,
    PSI_DOT,
    R_DOT,
    V_O,
    A,
    B,
    P,
    R,
    Stage,
)

LEAST = 1e-3
"""Smallest |F/F_h| used in the loss: |F/F_h|ⁿ is not differentiable at zero for n < 1."""


def thrust(s: Any, par: Any, mem: Any, out: Any) -> None:
    heave = s[L_A] * (math.cos(s[P]) * s[R_DOT] - math.cos(s[R]) * math.sin(s[P]) * s[PSI_DOT])
    tip = s[L_H] * (s[P_DOT] + math.sin(s[R]) * s[PSI_DOT])
    hover = s[K_F] * abs(s[V_O])
    for i in range(2):
        share = max(abs(out[i]) / hover, LEAST)
        v_n = heave + tip if i == 0 else heave - tip
        out[i] -= par[A] * hover * share ** par[B] * v_n


EFFECT = Effect(
    name="aero.inflow",
    summary="Less thrust when a rotor moves along its axis: F − k F_h |F/F_h|ⁿ v_n.",
    parameters=(
        Parameter("loss_s_per_m", "s/m", 0.0, -1.0, 3.0, 0.2, "k"),
        Parameter("exponent", "–", 1.0, -1.5, 3.5, 0.3, "n", prior_std=0.5),
    ),
    hooks={Stage.THRUST: thrust},
    order=3,
    confused_with=("friction.viscous",),
    separated_by="large",
    identifiable="quick climbs and descents while the thrust is known",
    evidence="roll_rate",
)
