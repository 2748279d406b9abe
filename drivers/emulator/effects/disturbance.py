"""External torque on an axis: constant τ, or τ sin(2π f t); τ in N·m, f in Hz, time t in s."""

from __future__ import annotations

import math

from ..plant_effects import Row, kernel
from ..plant_layout import AXIS, A, B, Stage, T
from .base import ALL_AXES, Effect, Parameter


@kernel
def bias(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[int(par[AXIS])] += par[A]


@kernel
def periodic(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[int(par[AXIS])] += par[A] * math.sin(2 * math.pi * par[B] * s[T])


EFFECTS = (
    Effect(
        name="bias.torque",
        summary="A constant torque, e.g. from an asymmetric body, a tilted base or a draught.",
        parameters=(Parameter("torque_Nm", "N·m", -0.5, 0.5, "the torque, positive as the angle"),),
        example="bias.torque.pitch:0.02",
        axes=("pitch", "yaw"),
        kernels={Stage.TORQUE: bias},
    ),
    Effect(
        name="disturbance.periodic",
        summary="A torque τ sin(2π f t).",
        parameters=(
            Parameter("torque_Nm", "N·m", 0.0, 1.0, "amplitude τ"),
            Parameter("frequency_Hz", "Hz", 0.001, 50.0, "frequency f"),
        ),
        example="disturbance.periodic.yaw:0.02@0.5",
        axes=ALL_AXES,
        kernels={Stage.TORQUE: periodic},
    ),
)
