"""Masses and inertias that differ from the profile's.

- ``mass.imbalance``: the level arm's gravity torque T_g is larger by τ in N·m (+: heavier body).
- ``inertia``: the level rig's inertia about the axis is ``ratio`` times the profile's. The
  difference is added as rotary inertia on the joint's shaft (ΔJ in `lagrange`).
- ``mass.change``: at time t₀ a mass m is added to the body on the pitch axis, at the arm's length
  L_a from the vertical axis. T_g grows by m g L_a, the body's inertias I_bb and I_nn (`lagrange`)
  by m L_a². The rates do not jump at t₀.
"""

from __future__ import annotations

from dataclasses import replace

from ..body import Setup, g
from ..plant_effects import Row, kernel
from ..plant_layout import I_BB, I_NN, L_A, T_G, A, B, Stage, T
from .base import ALL_AXES, Effect, Parameter


def _imbalance(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    body = setup.body
    return replace(setup, body=replace(body, T_g=body.T_g + values[0]))


def _inertia(setup: Setup, axis: int, values: tuple[float, ...]) -> Setup:
    dJ = list(setup.body.dJ)
    dJ[axis] += (values[0] - 1) * (setup.nominal.J[axis] + setup.nominal.dJ[axis])
    return replace(setup, body=replace(setup.body, dJ=(dJ[0], dJ[1], dJ[2])))


@kernel
def change(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    if s[T] >= par[B]:
        L_a = out[L_A]
        out[T_G] += par[A] * G * L_a
        out[I_BB] += par[A] * L_a * L_a
        out[I_NN] += par[A] * L_a * L_a


G = g

EFFECTS = (
    Effect(
        name="mass.imbalance",
        summary="The level arm's gravity torque differs from nominal (+: heavier body).",
        parameters=(Parameter("torque_Nm", "N·m", -1.0, 1.0, "added to T_g"),),
        example="mass.imbalance:0.1",
        setup=_imbalance,
    ),
    Effect(
        name="inertia",
        summary="The inertia of the axis differs from nominal.",
        parameters=(Parameter("ratio", "–", 0.5, 2.0, "to the profile's, at level"),),
        example="inertia.yaw:1.2",
        axes=ALL_AXES,
        setup=_inertia,
    ),
    Effect(
        name="mass.change",
        summary="A mass is added to the body during the run.",
        parameters=(
            Parameter("mass_kg", "kg", -0.2, 0.5, "the mass, at L_a on the pitch axis"),
            Parameter("time_s", "s", 0.0, 3600.0, "time on the device's clock"),
        ),
        example="mass.change:0.05@20",
        kernels={Stage.BODY: change},
    ),
)
