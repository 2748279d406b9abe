"""Friction and drag of the joints; q̇ is the rate in rad/s; τ_c (N·m), c, d are parameters.

Coulomb: −τ_c sgn(q̇); at rest, the torque that keeps the joint at rest, up to ±τ_c (set-valued, see
`heli3dof_drivers.emulator.kernel`). Viscous: −c q̇, c in
N·m·s/rad. Air drag: −d |q̇| q̇, d in N·m·s²/rad².
"""

from __future__ import annotations

from ..plant_effects import Row, kernel
from ..plant_layout import AXIS, R_DOT, A, Stage
from .base import ALL_AXES, Effect, Parameter


@kernel
def coulomb(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[int(par[AXIS])] += par[A]


@kernel
def viscous(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    out[axis] -= par[A] * s[R_DOT + axis]


@kernel
def quadratic(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    rate = s[R_DOT + axis]
    out[axis] -= par[A] * abs(rate) * rate


EFFECTS = (
    Effect(
        name="friction.coulomb",
        summary="Dry friction with stiction: −τ_c sgn(q̇), and at rest up to ±τ_c.",
        parameters=(Parameter("torque_Nm", "N·m", 0.0, 1.0, "τ_c"),),
        example="friction.coulomb.yaw:0.03",
        axes=ALL_AXES,
        kernels={Stage.DRY_FRICTION: coulomb},
    ),
    Effect(
        name="friction.viscous",
        summary="Viscous friction, proportional to the rate: −c q̇.",
        parameters=(Parameter("damping_Nms_per_rad", "N·m·s/rad", 0.0, 5.0, "c"),),
        example="friction.viscous.yaw:0.05",
        axes=ALL_AXES,
        kernels={Stage.TORQUE: viscous},
    ),
    Effect(
        name="drag.quadratic",
        summary="Air drag, quadratic in the rate: −d |q̇| q̇.",
        parameters=(Parameter("drag_Nms2_per_rad2", "N·m·s²/rad²", 0.0, 10.0, "d"),),
        example="drag.quadratic.yaw:0.2",
        axes=ALL_AXES,
        kernels={Stage.TORQUE: quadratic},
    ),
)
