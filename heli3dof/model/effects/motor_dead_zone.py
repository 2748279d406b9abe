"""Dead zone V_d of the motors: the voltage V acts as sgn(V) max(0, |V| − V_d), both in V."""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import A, Stage


def voltage(s: Any, par: Any, mem: Any, out: Any) -> None:
    for i in range(2):
        over = abs(out[i]) - par[A]
        if over < 0.0:
            over = 0.0
        out[i] = over if out[i] > 0.0 else -over


EFFECT = Effect(
    name="motor.dead_zone",
    summary="No thrust below this voltage, and that much less above.",
    parameters=(Parameter("voltage_V", "V", 0.0, 0.0, 8.0, 1.0, "V_d", start=0.3),),
    hooks={Stage.VOLTAGE: voltage},
    order=4,
    confused_with=("motor.thrust_curve", "mass.imbalance", "stiffness.pendulum"),
    separated_by="large",
    identifiable="several levels of thrust, and voltages near zero",
    evidence="voltage_front",
    probes=((0.3,), (1.5,)),
)
