"""First-order lag of each rotor's thrust F_i (N): τ_m Ḟ_i = f(V_i) − F_i, τ_m in s.

f(V) is the steady-state thrust at the voltage V. The solution is exact: V is held between samples,
so F approaches f(V) as exp(−t/τ_m).
"""

from __future__ import annotations

from typing import Any

from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import TAU_M, A, Stage


def setup(s: Any, par: Any, mem: Any, out: Any) -> None:
    out[TAU_M] = par[A]


EFFECT = Effect(
    name="motor.lag",
    summary="The rotors follow the voltage with a first-order lag.",
    parameters=(
        Parameter(
            "time_constant_s", "s", 0.0, 1e-3, 1.0, 0.1, "τ_m", log=True, prior_std=1.0, start=0.08
        ),
    ),
    hooks={Stage.SETUP: setup},
    confused_with=("motor.delay",),
    separated_by="chirp",
    identifiable="quick changes of voltage: doublets, a multisine or a chirp on pitch",
    evidence="voltage_difference",
    probes=((0.02,), (0.07,), (0.2,)),
)
