"""Dry friction: τ = −τ_c sgn(q̇), and in a joint at rest whatever holds it still, up to ±τ_c.

Set-valued, with no smoothing of the step: a joint that sticks does not creep. How it is stepped,
and what it does to a rate that is known only roughly, stands in `heli3dof.model.dry_friction`.
"""

from __future__ import annotations

from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.slots import AXIS, A, Stage


def dry(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[int(par[AXIS])] += par[A]


EFFECT = Effect(
    name="friction.coulomb",
    summary="Dry friction: −τ_c sgn(q̇), and at rest up to ±τ_c.",
    parameters=(Parameter("torque_Nm", "N·m", 0.0, -0.1, 1.0, 0.02, "τ_c"),),
    hooks={Stage.DRY: dry},
    axes=AXES,
    confused_with=("friction.viscous", "encoder.backlash"),
    separated_by="multisine",
)
