"""A constant delay T (s): at time t the motors have the voltage that was commanded at t − T.

In the sample interval in which a delayed voltage arrives, the motor first still has the previous
voltage. The model uses the time-weighted mean of both voltages, exact to second order in the
interval.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import DELAY, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[DELAY] += par[A]


EFFECT = Effect(
    name="motor.delay",
    summary="The voltage reaches the motors after a constant delay.",
    parameters=(Parameter("delay_s", "s", 0.0, 0.0, 0.2, 0.01, "the delay", start=0.002),),
    hooks={Stage.SETUP: setup},
    confused_with=("motor.lag",),
    separated_by="chirp",
    identifiable="quick changes of voltage: doublets, a multisine or a chirp on pitch",
    evidence="voltage_difference",
    probes=((0.004,), (0.02,)),
)
