"""Effects of masses and inertias that differ from the profile."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.axes import AXES
from heli3dof.model.effects.base import Effect, Parameter
from heli3dof.model.physics.state_layout import AXIS, J_R, L_A, PSI_DOT, R_DOT, A, B, R, Stage, T


def inertia_ratio(s: Any, par: Any, mem: Any, out: Any) -> None:
    """An axis' inertia differs from nominal: J → ratio · J.

    A fit estimates the parameters J_roll, J_pitch, J_yaw instead; this effect is for simulations.
    """
    out[J_R + int(par[AXIS])] *= par[A]


def inertia_product(s: Any, par: Any, mem: Any, out: Any) -> None:
    """A product of inertia: the centrifugal force pushes masses below the roll axis outwards.

    The product of inertia is P = Σ m x z in kg·m². A mass m is at the distance x from the yaw axis,
    along the level arm, and at the distance z below the arm. x is positive on the body's side and
    negative on the counterweight's. At the roll angle r and the yaw rate ψ̇, the torques are

        τ_roll = P ψ̇² cos(2r)          τ_yaw = −2 P ṙ ψ̇ cos(2r)

    Both follow from the kinetic energy ½ ψ̇² Σ m (x cos r + z sin r)². P is positive for a body
    that hangs below the arm. A counterweight that hangs below the arm reduces P. With masses below
    the roll axis, the arm is also a pendulum (effect `stiffness.pendulum`, k = g Σ m z with gravity
    g). The change of the yaw inertia J_yaw by P sin(2r) is neglected: a few per cent of J_yaw at
    the angles of flight.
    """
    c = par[A] * math.cos(2.0 * s[R])
    out[0] += c * s[PSI_DOT] * s[PSI_DOT]
    out[2] -= 2.0 * c * s[R_DOT] * s[PSI_DOT]


PUT_DOWN_S = 0.1
"""s, the time over which the weight grows to its full value."""


def mass_change(s: Any, par: Any, mem: Any, out: Any) -> None:
    """A mass m (kg) is added to the body during the flight, L_a (m) from the yaw axis.

    The effect's parameters are m and the time t_m (s) of the change. After t_m, the mass causes the
    torque −m g L_a cos r at the roll angle r, with gravity g. The torque grows over 0.1 s centred
    at t_m, because a step has no derivative with respect to t_m. The inertia m L_a² about the roll
    and yaw axes is neglected. In slow flight, its torque is a few per cent of the weight's torque.
    """
    on = 0.5 + (s[T] - par[B]) / PUT_DOWN_S
    if on > 0.0:
        out[0] -= min(on, 1.0) * par[A] * 9.81 * s[L_A] * math.cos(s[R])


def imbalance(s: Any, par: Any, mem: Any, out: Any) -> None:
    """The gravity torque on roll differs from nominal by −τ cos r at the roll angle r; τ in N·m.

    τ > 0 for a heavier body. If the weight is the same in all recordings, a fit estimates the
    gravity torque T_g instead. This effect is for simulations, and for rigs whose weight (or
    thrust) differs between recordings.
    """
    out[0] -= par[A] * math.cos(s[R])


EFFECTS = (
    Effect(
        name="inertia",
        summary="The axis' inertia differs from nominal.",
        parameters=(Parameter("ratio", "–", 1.0, 0.3, 3.0, 0.15, "to nominal", prior_std=0.3),),
        hooks={Stage.SETUP: inertia_ratio},
        axes=AXES,
        confused_with=("motor.thrust_gain",),
        separated_by="multisine",
        identifiable="any accelerated flight; it is a parameter of the rigid body",
        evidence="{axis}",
        candidate=False,  # equivalent to a parameter of the rigid body
    ),
    Effect(
        name="inertia.product",
        summary="Centrifugal torque of masses below the roll axis: P cos 2r ψ̇² on roll.",
        parameters=(Parameter("product_kgm2", "kg·m²", 0.0, -1.0, 1.0, 0.1, "P = Σ m x z"),),
        hooks={Stage.TORQUE: inertia_product},
        confused_with=("stiffness.pendulum", "inertia"),
        separated_by="coast-down",
        identifiable="fast yaw, turn after turn, with roll free",
        evidence="yaw_rate",
        candidate=False,  # only many turns in yaw show it, in multi-step predictions
    ),
    Effect(
        name="mass.change",
        summary="A mass is added to the body during the flight.",
        parameters=(
            Parameter("mass_kg", "kg", 0.0, -0.3, 1.0, 0.02, "the mass"),
            Parameter(
                "time_s", "s", 0.0, 0.0, 3600.0, 10.0, "when", prior_std=1e4, per_recording=True
            ),
        ),
        hooks={Stage.TORQUE: mass_change},
        confused_with=("mass.imbalance",),
        separated_by="levels",
        identifiable="steady flight before and after",
        evidence="time",
        scan="instant",
    ),
    Effect(
        name="mass.imbalance",
        summary="The level arm's gravity torque differs from nominal.",
        parameters=(Parameter("torque_Nm", "N·m", 0.0, -2.0, 2.0, 0.1, "added to T_g"),),
        hooks={Stage.TORQUE: imbalance},
        confused_with=("motor.thrust_gain",),
        separated_by="levels",
        identifiable="any flight; it is a parameter of the rigid body",
        evidence="time",
        candidate=False,  # equivalent to a parameter of the rigid body
    ),
)
