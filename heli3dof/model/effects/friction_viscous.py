"""Viscous friction torque τ = −c q̇ on an axis with the rate q̇ (rad/s), c in N·m·s/rad."""

from __future__ import annotations

from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, R_DOT, A, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    out[i] -= par[A] * s[R_DOT + i]


EFFECT = Effect(
    name="friction.viscous",
    summary="Friction proportional to the rate: −c q̇.",
    parameters=(Parameter("damping_Nms_per_rad", "N·m·s/rad", 0.0, -0.5, 5.0, 0.05, "c"),),
    hooks={Stage.TORQUE: torque},
    axes=AXES,
    confused_with=("friction.coulomb", "drag.quadratic", "aero.inflow"),
    separated_by="multisine",
    identifiable="several speeds on the axis",
    evidence="{axis}_rate",
)
