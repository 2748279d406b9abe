"""More thrust near the table: F → F (1 + a exp(−h/h₀)), h a rotor's height (m) above the table.

    h = max(L_a (sin r − sin r_rest) ± L_h sin p cos r, 0)     (+ front rotor, − back rotor)

r, p are roll and pitch, r_rest roll at rest on the table, L_a the distance from the yaw axis to the
body, L_h from the body to a rotor (m). F is the rotor's thrust, a its relative increase at the
table. h₀ is the height over which the increase falls to 1/e: 0.1 m unless estimated. The lower
rotor of a tilted body thrusts more (a > 0), which turns the body back to level.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import SMALL, Effect, Parameter
from heli3dof.model.physics.state_layout import L_A, L_H, REST, A, B, P, R, Stage


def thrust(s: Any, par: Any, mem: Any, out: Any) -> None:
    body = s[L_A] * (math.sin(s[R]) - math.sin(s[REST]))
    tip = s[L_H] * math.sin(s[P]) * math.cos(s[R])
    out[0] *= 1.0 + par[A] * math.exp(-max(body + tip, 0.0) / par[B])
    out[1] *= 1.0 + par[A] * math.exp(-max(body - tip, 0.0) / par[B])


EFFECT = Effect(
    name="aero.ground_effect",
    summary="More thrust near the table: F (1 + a exp(−h/h₀)).",
    parameters=(
        Parameter("thrust_share", "–", 0.0, -0.5, 3.0, 0.2, "a, at the table"),
        Parameter("height_m", "m", 0.1, 0.02, 1.0, 0.1, "h₀", log=True, prior_std=0.5),
    ),
    hooks={Stage.THRUST: thrust},
    order=2,
    confused_with=("stiffness.pendulum",),
    separated_by="large",
    identifiable="flight at several heights, one of them within 20 cm of the table",
    evidence="roll",
    probes=tuple((SMALL * 0.2, height) for height in (0.05, 0.1, 0.25)),
)
