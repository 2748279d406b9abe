"""More thrust near the table: F → F (1 + a exp(−h/h₀)), h the body's height (m) above the table.

h = L_a (sin r − sin r_rest) with arm length L_a (m), roll r, and roll r_rest at rest on the table.
F is a rotor's thrust, a its relative increase at the table. h₀ is the height over which the
increase falls to 1/e: 0.1 m unless estimated.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import SMALL, Effect, Parameter
from heli3dof.model.physics.state_layout import L_A, REST, A, B, R, Stage


def thrust(s: Any, par: Any, mem: Any, out: Any) -> None:
    height = s[L_A] * (math.sin(s[R]) - math.sin(s[REST]))
    if height < 0.0:
        height = 0.0
    more = 1.0 + par[A] * math.exp(-height / par[B])
    out[0] *= more
    out[1] *= more


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
