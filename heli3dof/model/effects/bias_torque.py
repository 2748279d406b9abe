"""A constant torque: from an unbalanced body on pitch, a tilted base or a draught on yaw.

τ = τ_b in N·m, positive in the direction of the growing angle. This effect does not exist on roll:
there the estimated gravity torque T_g of the arm includes a constant torque.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, A, Stage


def torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[int(par[AXIS])] += par[A]


EFFECT = Effect(
    name="bias.torque",
    summary="A constant torque.",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -1.0, 1.0, 0.02, "τ_b"),),
    hooks={Stage.TORQUE: torque},
    axes=("pitch", "yaw"),
    confused_with=("encoder.offset", "motor.thrust_mismatch"),
    separated_by="large",
    identifiable="any flight; distinguished from an encoder's offset only if the thrust varies",
    evidence="time",
)
