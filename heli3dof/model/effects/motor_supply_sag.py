"""Supply sag under load: a motor's voltage V acts as V (1 − k (|V_front| + |V_back|)), k in 1/V."""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import A, Stage


def voltage(s: Any, par: Any, mem: Any, out: Any) -> None:
    left = 1.0 - par[A] * (abs(out[0]) + abs(out[1]))
    if left < 0.0:
        left = 0.0
    out[0] *= left
    out[1] *= left


EFFECT = Effect(
    name="motor.supply_sag",
    summary="The supply sags under load: V (1 − k (|V_f| + |V_b|)).",
    parameters=(Parameter("sag_per_V", "1/V", 0.0, -0.01, 0.03, 0.003, "k"),),
    hooks={Stage.VOLTAGE: voltage},
    order=2,
    confused_with=("motor.thrust_curve", "motor.saturation"),
    separated_by="large",
    identifiable="a wide range of both motors' voltage",
    evidence="voltage_sum",
)
