"""What the hover model leaves out of the rigid body: q̈ = (1 − a) q̈_hover + a q̈_rigid.

a is the share of the rigid body, 1 where its geometry is all of it: gravity's torque that falls
with cos r, thrust that tilts with the body (L_a cos p F, −L_a cos r sin p F in place of −T_g p),
L_h sin r D, inertias that turn, Coriolis and centrifugal torques
(`heli3dof.model.physics.rigid_body`). Both accelerations are those of the same state, thrusts and
parameters, so a is told in one filter, and q̈ is a straight line in it. An estimate may come out a
little beyond 0 and 1.

Whether it is there the recordings say, at a = 0. But a rig has its geometry whole or not at all, so
once it is there a is believed to be 1 (`heli3dof.model.effects.base.share`).
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import LINEAR, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[LINEAR] *= 1.0 - par[A]


EFFECT = Effect(
    name="geometry",
    summary="The rigid body in place of the paper's hover model (with `--base hover`).",
    parameters=(share("a, of the rigid body; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    order=1,
    confused_with=("stiffness.pendulum", "aero.ground_effect"),
    separated_by="large",
    identifiable="flight 5° or more from level, or with the thrust varied while tilted",
    evidence="roll",
    within="base.hover",
)
