"""Equations without products of rates: no centrifugal and Coriolis torques.

These equations omit −J_r sin r cos r ψ̇² on roll r and J_p sin p cos p (ṙ² − cos² r ψ̇²) on pitch
p, with yaw ψ and inertias J (`heli3dof.model.physics.rigid_body`). The omitted share is the
parameter μ (0 … 1), for models with the effect ``simplified.couplings``. A diagnosis does not
report this choice of equations as a finding.
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, share
from heli3dof.model.physics.state_layout import WITHOUT_RATE_PRODUCTS, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[WITHOUT_RATE_PRODUCTS] = par[A]


EFFECT = Effect(
    name="simplified.rates",
    summary="Products of rates are omitted, as in the simplest equations.",
    parameters=(share("μ; 1 all of it"),),
    hooks={Stage.SETUP: setup},
    confused_with=("inertia.product",),
    separated_by="large",
    identifiable="fast yaw with roll off level",
    evidence="yaw_rate",
    within="simplified.couplings",
    formal=True,
)
