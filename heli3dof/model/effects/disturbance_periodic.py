"""A torque τ_0 sin(2π f t + φ) in N·m; f in Hz, φ in rad, t in s from the recording's start."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, A, B, C, Stage, T


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[int(par[AXIS])] += par[A] * math.sin(2.0 * math.pi * par[B] * s[T] + par[C])


EFFECT = Effect(
    name="disturbance.periodic",
    summary="A torque τ_0 sin(2π f t + φ).",
    parameters=(
        Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.02, "τ_0"),
        Parameter("frequency_Hz", "Hz", 1.0, 0.01, 50.0, 1.0, "f", prior_std=30.0),
        Parameter(
            "phase_rad", "rad", 0.0, -10.0, 10.0, 1.0, "φ", prior_std=10.0, per_recording=True
        ),
    ),
    hooks={Stage.TORQUE: torque},
    axes=AXES,
    separated_by="steps",
    identifiable="a flight of several periods",
    evidence="time",
    scan="frequency",
)
