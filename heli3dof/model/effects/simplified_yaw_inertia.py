"""Equations with a constant inertia about the vertical: J_ψ ψ̈ instead of J_ψ(r) ψ̈, ψ the yaw.

At roll r the rigid body has J_ψ(r) = (J_ψ − J_p) cos² r + J_p, 7 % less at 15°. The change of J_ψ
causes a torque 2 (J_ψ − J_p) sin r cos r ṙ ψ̇ (`heli3dof.model.physics.rigid_body`). The parameter
ν (0 … 1) is the omitted share of change and torque. A diagnosis does not report this choice of
equations as a finding.
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
