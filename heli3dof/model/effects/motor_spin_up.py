"""The amplifier's current limit bounds how fast a rotor spins up: dΩ/dt ≤ 1/p.

Ω is the rotor's speed, expressed as the voltage (V) that causes it in steady state; the parameter p
is in s/V. Spinning down has no limit. The solution is exact: a straight line while the limit is
active, then the exponential of the effect `motor.lag`.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import SLEW, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    if par[A] > 1e-6:
        out[SLEW] = 1.0 / par[A]


EFFECT = Effect(
    name="motor.spin_up",
    summary="A rotor spins up no faster than so many volts per second.",
    parameters=(
        Parameter("slowness_s_per_V", "s/V", 0.0, 0.0, 0.5, 0.02, "p, 1/slew", start=0.015),
    ),
    hooks={Stage.SETUP: setup},
    order=1,
    confused_with=("motor.lag", "motor.delay", "motor.saturation"),
    separated_by="large",
    identifiable="large steps of voltage upwards",
    evidence="voltage_sum",
)
