"""Simplified equations that keep the yaw torque L_h D sin r of tilted thrusts.

D = F_f − F_b (N) is the difference of front and back thrust. L_h (m) is the distance from the
body's axis to a motor; r and p are roll and pitch. In the complete rigid body, the inertia coupling
J_p sin r p̈ cancels most of this torque, because the pitch acceleration p̈ is nearly proportional to
D (see `physics.rigid_body`). Simplified equations without this coupling may keep the torque; the
parameter η (0 … 1) scales it. This effect is for models with the effect ``simplified.couplings``. A
diagnosis does not report it.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import SIDE_THRUST, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[SIDE_THRUST] = par[A]


EFFECT = Effect(
    name="simplified.side_thrust",
    summary="The thrust difference turns a tilted rig, with couplings omitted.",
    parameters=(share("η; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    confused_with=("aero.reaction_torque",),
    separated_by="large",
    identifiable="pitch moved fast with roll off level",
    evidence="voltage_difference",
    within="simplified.couplings",
    formal=True,
)
