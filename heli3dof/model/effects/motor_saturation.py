"""The motor voltage saturates below the amplifier's limit: V acts as clip(V, ±limit)."""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import A, Stage


def voltage(s: Any, par: Any, mem: Any, out: Any) -> None:
    for i in range(2):
        if out[i] > par[A]:
            out[i] = par[A]
        elif out[i] < -par[A]:
            out[i] = -par[A]


EFFECT = Effect(
    name="motor.saturation",
    summary="The motor voltage saturates below the amplifier's limit.",
    parameters=(Parameter("limit_V", "V", 100.0, 1.0, 100.0, 10.0, "the limit", start=12.0),),
    hooks={Stage.VOLTAGE: voltage},
    order=3,
    confused_with=("motor.supply_sag",),
    separated_by="large",
    identifiable="voltages above the limit",
    evidence="voltage_sum",
    probe_quantiles=(0.999, 0.995, 0.98, 0.95, 0.88),
)
