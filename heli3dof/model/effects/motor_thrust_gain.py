"""Both motors' thrust per volt is k times the profile's K_f.

A flight does not identify k: the gravity torque and the three inertias, divided by k, give the same
motion (`heli3dof.model.physics.rigid_body`). This effect is for simulations.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import GAIN_BACK, GAIN_FRONT, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[GAIN_FRONT] *= par[A]
    out[GAIN_BACK] *= par[A]


EFFECT = Effect(
    name="motor.thrust_gain",
    summary="Both motors thrust k times as much as K_f says.",
    parameters=(Parameter("gain", "–", 1.0, 0.2, 4.0, 0.2, "k", prior_std=0.15),),
    hooks={Stage.SETUP: setup},
    confused_with=("mass.imbalance", "inertia"),
    separated_by="levels",
    identifiable="a weighed part; otherwise equivalent to a scale of all masses",
    evidence="voltage_sum",
    candidate=False,  # equivalent to a parameter of the rigid body
)
