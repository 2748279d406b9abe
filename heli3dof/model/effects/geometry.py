"""The parts of the rigid body that the hover model omits: q̈ = (1 − a) q̈_hover + a q̈_rigid.

q̈ are the angular accelerations of roll r, pitch p, yaw ψ. The parameter a is 0 for the hover model
and 1 for the complete rigid body. The omitted parts are (T_g: gravity torque; see
`heli3dof.model.physics.rigid_body`):

* the gravity torque's factor cos r
* the thrust F that tilts with the body, at the distance L_a from the yaw axis:
  L_a cos p F on roll, −L_a cos r sin p F (not −T_g p) on yaw
* the yaw torque L_h sin r D of the thrust difference D, with rotors at ±L_h
* inertias that depend on the angles, Coriolis and centrifugal torques

A score test at a = 0 shows whether recordings need these parts. In a model with this effect, a has
the prior N(1, 0.2²) (`heli3dof.model.effects.base.share`).
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
