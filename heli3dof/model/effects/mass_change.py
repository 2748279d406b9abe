"""A mass m (kg) is added to the body during the flight, at the distance L_a (m) from the yaw axis.

After the time t_m (s), a parameter, the torque on roll r is −m g L_a cos r, with gravity g. The
torque grows over 0.1 s centred at t_m, because a step has no derivative with respect to t_m. The
inertia m L_a² on roll and yaw is neglected: a few per cent of the weight's effect in slow flight.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import L_A, A, B, R, Stage, T

PUT_DOWN_S = 0.1
"""s, the time over which the weight grows to its full value."""


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    on = 0.5 + (s[T] - par[B]) / PUT_DOWN_S
    if on > 0.0:
        out[0] -= min(on, 1.0) * par[A] * 9.81 * s[L_A] * math.cos(s[R])


EFFECT = Effect(
    name="mass.change",
    summary="A mass is added to the body during the flight.",
    parameters=(
        Parameter("mass_kg", "kg", 0.0, -0.3, 1.0, 0.02, "the mass"),
        Parameter("time_s", "s", 0.0, 0.0, 3600.0, 10.0, "when", prior_std=1e4, per_recording=True),
    ),
    hooks={Stage.TORQUE: torque},
    confused_with=("mass.imbalance",),
    separated_by="levels",
    identifiable="steady flight before and after",
    evidence="time",
    scan="instant",
)
