"""The level arm's gravity torque differs from nominal: T_g → T_g + τ, + for a heavier body.

The base parameter T_g already holds it; it is here for simulating with it.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.slots import T_G, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[T_G] += par[A]


EFFECT = Effect(
    name="mass.imbalance",
    summary="The level arm's gravity torque differs from nominal.",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -2.0, 2.0, 0.1, "added to T_g"),),
    hooks={Stage.SETUP: setup},
    confused_with=("motor.thrust_gain",),
    separated_by="levels",
    identifiable="any flight; it is a parameter of the base",
    evidence="time",
)
