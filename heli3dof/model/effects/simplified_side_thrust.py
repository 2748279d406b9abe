"""The thrusts' difference turns the tilted rig: L_h sin r D on yaw, where couplings are left out.

In the whole body M_pψ p̈ takes most of it away again: pitch follows D. Equations that project the
thrusts but not the inertias keep it (`heli3dof.model.physics.rigid_body`). Like
`simplified_couplings`, without which it means nothing, this belongs to the base and is never told
as a cause.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import SIDEWAYS, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[SIDEWAYS] = par[A]


EFFECT = Effect(
    name="simplified.side_thrust",
    summary="The thrusts' difference turns a tilted rig, whose couplings are left out.",
    parameters=(share("η; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    confused_with=("aero.reaction_torque",),
    separated_by="large",
    identifiable="pitch moved fast with roll off level",
    evidence="voltage_difference",
    within="simplified.couplings",
    formal=True,
)
