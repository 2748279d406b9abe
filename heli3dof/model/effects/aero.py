"""Effects of the air and of the propellers on thrust and torque."""

from __future__ import annotations

import math
from typing import Any

from heli3dof.model.effects.base import SMALL, Effect, Parameter
from heli3dof.model.physics.state_layout import (
    F_BACK,
    F_FRONT,
    K_F,
    L_A,
    L_H,
    P_DOT,
    PSI_DOT,
    R_DOT,
    REST,
    SPEED_BACK,
    SPEED_FRONT,
    V_O,
    A,
    B,
    P,
    R,
    Stage,
)


def flapping(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Rotor flapping: rotors that travel sideways exert a torque on pitch, τ_pitch = k ψ̇.

    At the travel speed L_a ψ̇ (arm length times yaw rate) the advancing blades lift more than the
    retreating ones. Two propellers that turn in the same direction then exert a moment about the
    arm's long axis, the axis of pitch; k is in N·m·s/rad.
    """
    out[1] += par[A] * s[PSI_DOT]


def ground_effect(s: Any, par: Any, mem: Any, out: Any) -> None:
    """More thrust near the table: F → F (1 + a exp(−h/h₀)), h a rotor's height (m) above the table.

        h = max(L_a (sin r − sin r_rest) ± L_h sin p cos r, 0)     (+ front rotor, − back rotor)

    r, p are roll and pitch, r_rest roll at rest on the table, L_a the distance from the yaw axis to
    the body, L_h from the body to a rotor (m). F is the rotor's thrust, a its relative increase at
    the table. h₀ is the height over which the increase falls to 1/e: 0.1 m unless estimated. The
    lower rotor of a tilted body thrusts more (a > 0), which turns the body back to level.
    """
    body = s[L_A] * (math.sin(s[R]) - math.sin(s[REST]))
    tip = s[L_H] * math.sin(s[P]) * math.cos(s[R])
    out[0] *= 1.0 + par[A] * math.exp(-max(body + tip, 0.0) / par[B])
    out[1] *= 1.0 + par[A] * math.exp(-max(body - tip, 0.0) / par[B])


def gyroscopic(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Gyroscopic torques of the propellers, whose angular momentum is H = k (Ω_f + Ω_b).

    H points along the body's normal n. Ω_f, Ω_b are the rotors' speeds, expressed as the voltages
    (V) that cause them in steady state; k in N·m·s/V. At the angular velocity ω the body gets the
    couple −ω×H n. Let a be the arm's direction, b that of the bar that carries the motors. With
    roll r, pitch p, yaw ψ, ω has the components

        ω_a = ṗ + sin r ψ̇             ω_b = −cos p ṙ + cos r sin p ψ̇

    so the couple along a, b is (−H ω_b, H ω_a). It does no work on the body. By virtual work,

        τ_roll = −cos p H ω_a,  τ_pitch = −H ω_b,  τ_yaw = H (cos r sin p ω_a − sin r ω_b)
    """
    H = par[A] * (s[SPEED_FRONT] + s[SPEED_BACK])
    sr, cr = math.sin(s[R]), math.cos(s[R])
    sp, cp = math.sin(s[P]), math.cos(s[P])
    about_a = s[P_DOT] + sr * s[PSI_DOT]
    about_b = -cp * s[R_DOT] + cr * sp * s[PSI_DOT]
    along_a, along_b = -H * about_b, H * about_a
    out[0] += -cp * along_b
    out[1] += along_a
    out[2] += sr * along_a + cr * sp * along_b


LEAST = 1e-3
"""Smallest |F/F_h| used in the loss: |F/F_h|ⁿ is not differentiable at zero for n < 1."""


def inflow(s: Any, par: Any, mem: Any, out: Any) -> None:
    """A rotor that moves in its thrust's direction thrusts less: F → F − k F_h |F/F_h|ⁿ v_n.

    F is a rotor's thrust (N), F_h its thrust at hover. k (s/m) and n are the parameters of the
    effect. v_n (m/s) is the rotor's speed along the body's normal, the direction of positive
    thrust:

        v_n = L_a (cos p ṙ − cos r sin p ψ̇) ± L_h (ṗ + sin r ψ̇)     (+ front rotor, − back rotor)

    r, p, ψ are roll, pitch, yaw; L_a is the distance from yaw axis to body, L_h from body to rotor
    (m). At hover the loss is k F_h v_n for every n.

    * n = 1: the loss is proportional to the thrust: F → F (1 − k v_n).
    * n = 1/2: the loss is proportional to the rotor's speed Ω, with F ∝ Ω², as for a propeller.
    * n = 0: the loss does not depend on the thrust. On a level rig it equals viscous friction on
      roll and pitch with coefficients in the ratio (L_a/L_h)².
    """
    heave = s[L_A] * (math.cos(s[P]) * s[R_DOT] - math.cos(s[R]) * math.sin(s[P]) * s[PSI_DOT])
    tip = s[L_H] * (s[P_DOT] + math.sin(s[R]) * s[PSI_DOT])
    hover = s[K_F] * abs(s[V_O])
    for i in range(2):
        share = max(abs(out[i]) / hover, LEAST)
        v_n = heave + tip if i == 0 else heave - tip
        out[i] -= par[A] * hover * share ** par[B] * v_n


def reaction_torque(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Reaction torque of the propellers about the body's normal: M = κ F_h Σ sgn(F_i) |F_i/F_h|ⁿ.

    F_i is the thrust (N) of the front and the back rotor, F_h a rotor's thrust at hover. κ (m) is
    the ratio of torque to thrust at hover; r, p, ψ are roll, pitch, yaw. ω_n is the angular
    velocity about the normal. The couple M along the normal has the power M ω_n = M (sin p ṙ + cos
    r cos p ψ̇). So τ_roll = M sin p and τ_yaw = M cos r cos p.

    * n = 1: the torque is proportional to the thrust.
    * n = 2: the torque grows with V² although the model's thrust is linear in the voltage V.
    """
    hover = s[K_F] * abs(s[V_O])
    front = math.copysign((abs(s[F_FRONT]) / hover) ** par[B], s[F_FRONT])
    back = math.copysign((abs(s[F_BACK]) / hover) ** par[B], s[F_BACK])
    couple = par[A] * hover * (front + back)
    out[0] += couple * math.sin(s[P])
    out[2] += couple * math.cos(s[R]) * math.cos(s[P])


def counter_rotation(s: Any, par: Any, mem: Any, out: Any) -> None:
    """Reaction torque of propellers that turn in opposite directions: M = κ F_h (σ_f − σ_b).

        σ_i = sgn(F_i) |F_i/F_h|ⁿ     (i = f, b)

    The symbols and the virtual work are those of `reaction_torque`, where both propellers turn in
    the same direction. At equal thrusts the two reaction torques cancel.
    """
    hover = s[K_F] * abs(s[V_O])
    front = math.copysign((abs(s[F_FRONT]) / hover) ** par[B], s[F_FRONT])
    back = math.copysign((abs(s[F_BACK]) / hover) ** par[B], s[F_BACK])
    couple = par[A] * hover * (front - back)
    out[0] += couple * math.sin(s[P])
    out[2] += couple * math.cos(s[R]) * math.cos(s[P])


EFFECTS = (
    Effect(
        name="aero.counter_rotation",
        summary="Opposite propellers twist the body about its normal by κ F_h (σ_f − σ_b).",
        parameters=(
            Parameter("torque_per_thrust_m", "m", 0.0, -0.3, 0.3, 0.02, "κ"),
            Parameter("exponent", "–", 1.0, 0.5, 3.5, 0.3, "n", prior_std=0.5),
        ),
        hooks={Stage.TORQUE: counter_rotation},
        separated_by="large",
        identifiable="quick pitch motion: the torque on yaw follows the voltages' difference",
        evidence="voltage_difference",
    ),
    Effect(
        name="aero.flapping",
        summary="Travelling sideways tilts the body: a torque kψ̇ on pitch.",
        parameters=(Parameter("moment_Nms_per_rad", "N·m·s/rad", 0.0, -2.0, 2.0, 0.05, "k"),),
        hooks={Stage.TORQUE: flapping},
        confused_with=("aero.gyroscopic",),
        separated_by="large",
        identifiable="fast travel with pitch free: yaw steps",
        evidence="yaw_rate",
    ),
    Effect(
        name="aero.ground_effect",
        summary="More thrust near the table: F (1 + a exp(−h/h₀)).",
        parameters=(
            Parameter("thrust_share", "–", 0.0, -0.5, 3.0, 0.2, "a, at the table"),
            Parameter("height_m", "m", 0.1, 0.02, 1.0, 0.1, "h₀", log=True, prior_std=0.5),
        ),
        hooks={Stage.THRUST: ground_effect},
        order=2,
        confused_with=("stiffness.pendulum",),
        separated_by="large",
        identifiable="flight at several heights, one of them within 20 cm of the table",
        evidence="roll",
        probes=tuple((SMALL * 0.2, height) for height in (0.05, 0.1, 0.25)),
    ),
    Effect(
        name="aero.gyroscopic",
        summary="The propellers' angular momentum resists being turned: −ω × H.",
        parameters=(Parameter("momentum_Nms_per_V", "N·m·s/V", 0.0, -0.05, 0.05, 0.001, "k"),),
        hooks={Stage.TORQUE: gyroscopic},
        separated_by="large",
        identifiable="fast pitch and roll together: their torques cross over",
        evidence="pitch_rate",
    ),
    Effect(
        name="aero.inflow",
        summary="Less thrust when a rotor moves along its axis: F − k F_h |F/F_h|ⁿ v_n.",
        parameters=(
            Parameter("loss_s_per_m", "s/m", 0.0, -1.0, 3.0, 0.2, "k"),
            Parameter("exponent", "–", 1.0, -1.5, 3.5, 0.3, "n", prior_std=0.5),
        ),
        hooks={Stage.THRUST: inflow},
        order=3,
        confused_with=("friction.viscous",),
        separated_by="large",
        identifiable="quick climbs and descents while the thrust is known",
        evidence="roll_rate",
    ),
    Effect(
        name="aero.reaction_torque",
        summary="The propellers twist the body about its normal by κ F_h Σ sgn(F) |F/F_h|ⁿ.",
        parameters=(
            Parameter("torque_per_thrust_m", "m", 0.0, -0.3, 0.3, 0.02, "κ"),
            Parameter("exponent", "–", 1.0, 0.5, 3.5, 0.3, "n", prior_std=0.5),
        ),
        hooks={Stage.TORQUE: reaction_torque},
        confused_with=("bias.torque.yaw", "encoder.offset.pitch"),
        separated_by="large",
        identifiable="several common voltages: the torque on yaw grows with the thrust",
        evidence="voltage_sum",
    ),
)
