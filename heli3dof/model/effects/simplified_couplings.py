"""Equations without inertia couplings of the axes: q̈ = (1 − κ) q̈_rigid + κ q̈_alone.

Equations of this rig are often written for each axis alone. Their accelerations q̈_alone lack the
couplings by the inertia of the bar with the motors. The complete rigid body's q̈_rigid contain them
(`heli3dof.model.physics.rigid_body`). The largest omitted torque is −J_p sin r ψ̈ on pitch, up to
0.01 N·m, with roll r, yaw ψ and the pitch inertia J_p. The parameter κ (0 … 1) scales the omission.
A simulated rig with such equations has no defect, so a diagnosis may use κ but does not report it
as a finding. In a model with this effect, κ has the prior N(1, 0.2²)
(`heli3dof.model.effects.base.share`).
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import UNCOUPLED, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[UNCOUPLED] = par[A]


EFFECT = Effect(
    name="simplified.couplings",
    summary="Inertia couplings are omitted, as in the simplified equations.",
    parameters=(share("κ, of what is omitted; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    confused_with=("stiffness.pendulum",),
    separated_by="large",
    identifiable="pitch and roll off level together",
    evidence="pitch",
    formal=True,
)
