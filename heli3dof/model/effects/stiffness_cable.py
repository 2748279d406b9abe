"""Torsional stiffness of the cable: torque τ = −k ψ on yaw ψ (rad), k in N·m/rad."""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, A, R, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    i = int(par[AXIS])
    out[i] -= par[A] * s[R + i]


EFFECT = Effect(
    name="stiffness.cable",
    summary="The cable twists with the yaw angle: −k ψ.",
    parameters=(Parameter("stiffness_Nm_per_rad", "N·m/rad", 0.0, -1.0, 3.0, 0.03, "k"),),
    hooks={Stage.TORQUE: torque},
    axes=("yaw",),
    confused_with=("bias.torque.yaw",),
    separated_by="large",
    identifiable="travel to both sides, half a turn apart",
    evidence="yaw",
)
