"""The encoder's zero was set at the wrong angle: reading = angle + offset.

On roll, an offset has the same effect as other values of the gravity and pendulum torques. On
pitch, a reading of zero means a true pitch angle of −offset. The thrust is then tilted and causes a
torque on yaw that is proportional to the offset.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, A, Stage


def measure(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[int(par[AXIS])] += par[A] * math.pi / 180.0


EFFECT = Effect(
    name="encoder.offset",
    summary="The zero was set at the wrong angle: reading = angle + offset.",
    parameters=(Parameter("angle_deg", "°", 0.0, -20.0, 20.0, 1.0, "the offset", prior_std=3.0),),
    hooks={Stage.MEASURE: measure},
    axes=AXES,
    order=2,
    confused_with=("bias.torque", "mass.imbalance"),
    separated_by="large",
    identifiable="large pitch or roll angles with the thrust varied",
    evidence="voltage_sum",
)
