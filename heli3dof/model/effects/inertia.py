"""An axis' inertia differs from nominal: J → ratio · J.

A fit estimates the parameters J_roll, J_pitch, J_yaw instead; this effect is for simulations.
"""

from __future__ import annotations

from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, J_R, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[J_R + int(par[AXIS])] *= par[A]


EFFECT = Effect(
    name="inertia",
    summary="The axis' inertia differs from nominal.",
    parameters=(Parameter("ratio", "–", 1.0, 0.3, 3.0, 0.15, "to nominal", prior_std=0.3),),
    hooks={Stage.SETUP: setup},
    axes=AXES,
    confused_with=("motor.thrust_gain",),
    separated_by="multisine",
    identifiable="any accelerated flight; it is a parameter of the rigid body",
    evidence="{axis}",
    candidate=False,  # equivalent to a parameter of the rigid body
)
