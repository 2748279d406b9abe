"""Equations without products of rates: no centrifugal and Coriolis torques.

These equations omit the torques −J_r sin r cos r ψ̇² on roll r, J_p sin p cos p (ṙ² − cos² r ψ̇²)
on pitch p, and 2 (J_ψ − J_p) sin r cos r ṙ ψ̇ on yaw ψ. J are the axes' inertias
(`heli3dof.model.physics.rigid_body`). The parameter μ (0 … 1) scales the omission. This effect is
for models with the effect ``simplified.couplings``. A diagnosis does not report it as a finding.
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
