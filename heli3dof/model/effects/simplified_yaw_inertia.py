"""Equations with a constant inertia about the vertical: J_ψ ψ̈ instead of J_ψ(r) ψ̈, ψ the yaw.

With the level rig's yaw and pitch inertias J_ψ and J_p, the rigid body at roll r has
J_ψ(r) = (J_ψ − J_p) cos² r + J_p, which is 7 % below J_ψ at r = 15°. As J_ψ(r) changes, it causes
the torque 2 (J_ψ − J_p) sin r cos r ṙ ψ̇ (`heli3dof.model.physics.rigid_body`). The parameter
ν (0 … 1) scales the omission of the change and its torque. A diagnosis does not report this choice
of equations as a finding.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import CONSTANT_YAW_INERTIA, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[CONSTANT_YAW_INERTIA] = par[A]


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
