"""Thrust grows as a power of the rotor's speed: F = K_f V_o (Ω/V_o)^n.

F is the thrust (N), K_f the thrust per volt, V_o the hover voltage. Ω is the rotor's speed,
expressed as the voltage (V) that causes it in steady state. `motor.thrust_curve` acts on the
voltage *before* the rotor's lag, this effect on the speed after the lag. A reversed propeller gives
almost no thrust; the model gives none. At the profile's V_o the thrust is K_f V_o for every n.
Without a lag, `motor.thrust_curve` with a dead zone is so similar that a one-minute flight does not
distinguish the two effects.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import K_F, V_O, A, Stage


def thrust(s: Any, par: Any, mem: Any, out: Any) -> None:
    hover = s[K_F] * abs(s[V_O])
    for i in range(2):
        if out[i] <= 0.0:
            out[i] = 0.0
        else:
            out[i] = hover * (out[i] / hover) ** par[A]


EFFECT = Effect(
    name="motor.rotor_curve",
    summary="Thrust grows as a power of the rotor's speed, behind the lag.",
    parameters=(Parameter("exponent", "–", 1.0, 0.4, 4.0, 0.5, "n", prior_std=1.0, start=1.5),),
    hooks={Stage.THRUST: thrust},
    order=1,
    confused_with=("motor.thrust_curve", "motor.dead_zone"),
    separated_by="large",
    identifiable="several levels of thrust with quick changes between",
    evidence="voltage_sum",
    requires="motor.lag",
)
