"""Torques that return an axis to a position."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, A, R, Stage


def cable(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Torsional stiffness of the cable: torque τ = −k ψ on yaw ψ (rad), k in N·m/rad."""
    i = int(par[AXIS])
    out[i] -= par[A] * s[R + i]


def pendulum(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The centre of mass lies off the axis: τ = −k sin q, q the angle of roll or pitch.

    k = m g d in N·m, with the moving mass m, gravity g, and the distance d of the mass's centre
    below the axis (negative: above). For k > 0 on roll, the arm is a pendulum with the natural
    frequency ω_n = √(k/J_roll): 1.0 to 1.8 rad/s on identified rigs.
    """
    i = int(par[AXIS])
    out[i] -= par[A] * math.sin(s[R + i])


EFFECTS = (
    Effect(
        name="stiffness.cable",
        summary="The cable twists with the yaw angle: −k ψ.",
        parameters=(Parameter("stiffness_Nm_per_rad", "N·m/rad", 0.0, -1.0, 3.0, 0.03, "k"),),
        hooks={Stage.TORQUE: cable},
        axes=("yaw",),
        confused_with=("bias.torque.yaw",),
        separated_by="large",
        identifiable="travel to both sides, half a turn apart",
        evidence="yaw",
    ),
    Effect(
        name="stiffness.pendulum",
        summary="The centre of mass lies below the axis (above if k < 0): −k sin q.",
        parameters=(
            Parameter("torque_Nm", "N·m", 0.0, -3.0, 10.0, 0.5, "k, times sin of the angle"),
        ),
        hooks={Stage.TORQUE: pendulum},
        axes=("roll", "pitch"),
        confused_with=("aero.ground_effect", "motor.dead_zone", "motor.thrust_curve"),
        separated_by="large",
        identifiable="steady flight at several angles, 10° apart or more",
        evidence="{axis}",
    ),
)
