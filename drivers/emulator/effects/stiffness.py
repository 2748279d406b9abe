"""Restoring torques that depend on the joint's angle q only; k is the parameter.

Pendulum: a centre of mass below the joint's axis gives −k sin q, k in N·m (k < 0: above the axis).
Cable: the cable bundle twisted by the yaw angle ψ (rad) gives −k ψ, k in N·m/rad.
"""

from __future__ import annotations

import math

from ..plant_effects import Row, kernel
from ..plant_layout import AXIS, A, R, Stage
from .base import Effect, Parameter


@kernel
def pendulum(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    out[axis] -= par[A] * math.sin(s[R + axis])


@kernel
def cable(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    axis = int(par[AXIS])
    out[axis] -= par[A] * s[R + axis]


EFFECTS = (
    Effect(
        name="stiffness.pendulum",
        summary="The centre of mass lies below the axis: −k sin q.",
        parameters=(Parameter("torque_Nm", "N·m", -2.0, 5.0, "k"),),
        example="stiffness.pendulum.roll:1.0",
        axes=("roll", "pitch"),
        kernels={Stage.TORQUE: pendulum},
    ),
    Effect(
        name="stiffness.cable",
        summary="The cable twists with the travel: −k ψ.",
        parameters=(Parameter("stiffness_Nm_per_rad", "N·m/rad", 0.0, 2.0, "k"),),
        example="stiffness.cable.yaw:0.05",
        axes=("yaw",),
        kernels={Stage.TORQUE: cable},
    ),
)
