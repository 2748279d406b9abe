"""The arm's inertia about the vertical is constant: J_ψ ψ̈ instead of J_ψ(r) ψ̈.

Tilted, the arm has (J_ψ − J_p) cos² r + J_p, 7 % less at 15°, and a torque 2 (J_ψ − J_p) sin r cos
r ṙ ψ̇ as that changes (`heli3dof.model.physics.rigid_body`). Simplified equations often omit both.
Like `simplified_couplings` this belongs to the base and is never reported as a finding.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import CONSTANT, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[CONSTANT] = par[A]


EFFECT = Effect(
    name="simplified.yaw_inertia",
    summary="The inertia about the vertical is constant, as in the simplified equations.",
    parameters=(share("ν, of what is omitted; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    confused_with=("inertia",),
    separated_by="large",
    identifiable="yaw at several roll angles, 10° apart or more",
    evidence="roll",
    formal=True,
)
