"""Rotor flapping: rotors that travel sideways exert a torque on pitch, τ_pitch = k ψ̇.

At the travel speed L_a ψ̇ (arm length times yaw rate) the advancing blades lift more than the
retreating ones. Two propellers that turn in the same direction then exert a moment about the arm; k
is in N·m·s/rad.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import PSI_DOT, A, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[1] += par[A] * s[PSI_DOT]


EFFECT = Effect(
    name="aero.flapping",
    summary="Travelling sideways tilts the body: a torque kψ̇ on pitch.",
    parameters=(Parameter("moment_Nms_per_rad", "N·m·s/rad", 0.0, -2.0, 2.0, 0.05, "k"),),
    hooks={Stage.TORQUE: torque},
    confused_with=("aero.gyroscopic",),
    separated_by="large",
    identifiable="fast travel with pitch free: yaw steps",
    evidence="yaw_rate",
)
