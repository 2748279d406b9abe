"""The bar's part in how roll, pitch and yaw push each other is left out: q̈ = q̈_rigid + κ (…).

Equations of this rig are often written one axis by itself: without M_rψ, M_pψ = J_p sin r, the
L_h sin r D that goes with it, and the bar's products of rates
(`heli3dof.model.physics.rigid_body`). What is missed most is −T_g sin r sin p on pitch, up to 0.01
N·m. A rig that is a simulation by such equations has nothing wrong with it: κ belongs to the base,
is never told as a cause, and is believed to be 1 (`heli3dof.model.effects.base.share`) once the
recordings ask for it: equations hold a term or they do not.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import UNCOUPLED, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[UNCOUPLED] = par[A]


EFFECT = Effect(
    name="simplified.couplings",
    summary="The body's inertia couplings are as in the simplified equations.",
    parameters=(share("κ, of what is left out; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    confused_with=("stiffness.pendulum",),
    separated_by="large",
    identifiable="pitch and roll off level together",
    evidence="pitch",
    formal=True,
)
