"""The gravity torque on roll differs from nominal by −τ cos r at the roll angle r; τ in N·m.

τ > 0 for a heavier body. A fit estimates the gravity torque T_g instead. This effect is for
simulations, and for rigs whose weight (or thrust) differs between recordings.
"""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import A, R, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[0] -= par[A] * math.cos(s[R])


EFFECT = Effect(
    name="mass.imbalance",
    summary="The level arm's gravity torque differs from nominal.",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -2.0, 2.0, 0.1, "added to T_g"),),
    hooks={Stage.TORQUE: torque},
    confused_with=("motor.thrust_gain",),
    separated_by="levels",
    identifiable="any flight; it is a parameter of the rigid body",
    evidence="time",
    candidate=False,  # equivalent to a parameter of the rigid body
)
