"""Air drag on an axis of rate q̇ (rad/s): torque −d |q̇| q̇ in N·m; d is the effect's parameter."""

from __future__ import annotations

from ..plant_effects import Row, kernel
from ..plant_layout import AXIS, R_DOT, A, Stage
from .base import ALL_AXES, Effect, Parameter


@kernel
def quadratic(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    rate = s[R_DOT + axis]
    out[axis] -= par[A] * abs(rate) * rate


EFFECTS = (
    Effect(
        name="drag.quadratic",
        summary="Air drag, quadratic in the rate: −d |q̇| q̇.",
        parameters=(Parameter("drag_Nms2_per_rad2", "N·m·s²/rad²", 0.0, 10.0, "d"),),
        example="drag.quadratic.yaw:0.2",
        axes=ALL_AXES,
        kernels={Stage.TORQUE: quadratic},
    ),
)
