"""Torques that depend neither on the state nor on the voltages."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, A, B, C, Stage, T


def bias(s: Any, par: Any, mem: Any, out: Any) -> None:
    """A constant torque: on pitch from an unbalanced body, on yaw from a tilted base or a draught.

    τ = τ_b in N·m, positive in the direction of the growing angle. This effect does not exist on
    roll: there the estimated gravity torque T_g of the arm includes a constant torque.
    """
    out[int(par[AXIS])] += par[A]


def periodic(s: Any, par: Any, mem: Any, out: Any) -> None:
    """A torque τ_0 sin(2π f t + φ) in N·m; f in Hz, φ in rad, t in s from the recording's start."""
    out[int(par[AXIS])] += par[A] * math.sin(2.0 * math.pi * par[B] * s[T] + par[C])


EFFECTS = (
    Effect(
        name="bias.torque",
        summary="A constant torque.",
        parameters=(Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.02, "τ_b"),),
        hooks={Stage.TORQUE: bias},
        axes=("pitch", "yaw"),
        confused_with=("encoder.offset", "motor.thrust_mismatch"),
        separated_by="large",
        identifiable="any flight; distinguished from an encoder's offset only if the thrust varies",
        evidence="time",
    ),
    Effect(
        name="disturbance.periodic",
        summary="A torque τ_0 sin(2π f t + φ).",
        parameters=(
            Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.02, "τ_0"),
            Parameter("frequency_Hz", "Hz", 1.0, 0.01, 50.0, 1.0, "f", prior_std=30.0),
            Parameter(
                "phase_rad", "rad", 0.0, -10.0, 10.0, 1.0, "φ", prior_std=10.0, per_recording=True
            ),
        ),
        hooks={Stage.TORQUE: periodic},
        axes=AXES,
        separated_by="steps",
        identifiable="a flight of several periods",
        evidence="time",
        scan="frequency",
    ),
)
