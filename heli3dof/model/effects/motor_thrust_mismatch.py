"""The front motor's thrust is m times the back motor's at equal voltages; the sum is unchanged.

The thrust per volt is K_f · 2m/(1 + m) in front and K_f · 2/(1 + m) at the back.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import GAIN_BACK, GAIN_FRONT, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    m = par[A]
    out[GAIN_FRONT] *= 2.0 * m / (1.0 + m)
    out[GAIN_BACK] *= 2.0 / (1.0 + m)


EFFECT = Effect(
    name="motor.thrust_mismatch",
    summary="The front motor thrusts m times as much as the back one.",
    parameters=(Parameter("front_over_back", "–", 1.0, 0.4, 2.5, 0.05, "m", prior_std=0.3),),
    hooks={Stage.SETUP: setup},
    confused_with=("bias.torque.pitch", "encoder.offset.pitch"),
    separated_by="large",
    identifiable="the thrust varied: the torque on pitch grows with it",
    evidence="voltage_sum",
)
