"""Part of the thrust grows with the square of the voltage: V acts as (1 − s) V + s V |V| / V_o.

s = 0 is the linear law, s = 1 a propeller's F ∝ V |V|, with the thrust F. At the profile's hover
voltage V_o the thrust is the same for every s.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import V_O, A, Stage


def voltage(s: Any, par: Any, mem: Any, out: Any) -> None:
    for i in range(2):
        out[i] *= 1.0 - par[A] + par[A] * abs(out[i]) / abs(s[V_O])


EFFECT = Effect(
    name="motor.thrust_curve",
    summary="Part of the thrust grows with V².",
    parameters=(Parameter("quadratic_share", "–", 0.0, -1.0, 2.0, 0.3, "s"),),
    hooks={Stage.VOLTAGE: voltage},
    order=5,
    confused_with=("motor.dead_zone", "motor.supply_sag", "stiffness.pendulum"),
    separated_by="large",
    identifiable="several levels of thrust",
    evidence="voltage_sum",
)
