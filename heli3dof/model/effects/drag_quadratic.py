"""Air drag torque τ = −d |q̇| q̇ on an axis with the rate q̇ (rad/s), d in N·m·s²/rad²."""

from __future__ import annotations

from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, R_DOT, A, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    out[i] -= par[A] * abs(s[R_DOT + i]) * s[R_DOT + i]


EFFECT = Effect(
    name="drag.quadratic",
    summary="Air drag growing with the square of the rate: −d |q̇| q̇.",
    parameters=(Parameter("drag_Nms2_per_rad2", "N·m·s²/rad²", 0.0, -2.0, 10.0, 0.1, "d"),),
    hooks={Stage.TORQUE: torque},
    axes=AXES,
    confused_with=("friction.viscous",),
    separated_by="large",
    identifiable="several speeds on the axis, well apart",
    evidence="{axis}_rate",
)
