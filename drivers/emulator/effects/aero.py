"""Effects of the air and the rotors on thrust and torque.

r, p, ψ are roll, pitch and yaw in rad, Q_r, Q_p, Q_ψ their torques. F is a rotor's thrust, F_f that
of the front, F_b of the back; V_f, V_b are the motor voltages. L_a is the arm's length, L_h the
distance of a rotor from the pitch axis. n is the body's normal and ω its angular velocity, with the
components ω_a along the arm and ω_b along the body's bar (`lagrange`). a, h₀, k, κ are parameters.

- Ground effect: near the table a rotor's thrust is F (1 + a exp(−h/h₀)). The rotor's height above
  the table is h = max(L_a (sin r − sin r_rest) ± L_h sin p cos r, 0), + for the front rotor, − for
  the back rotor. r_rest is the roll angle on the table.
- Inflow: a rotor that moves along its axis at v_n (m/s) has the thrust F (1 − k v_n). The factor
  1 − k v_n is limited to 0 … 2. v_n = L_a (cos p ṙ − cos r sin p ψ̇) ± L_h (ṗ + sin r ψ̇), + for the
  front rotor, − for the back rotor.
- Reaction torque: both propellers turn in the same direction; the torque M = κ (F_f + F_b) acts on
  the body about n. By virtual work: Q_r = M sin p, Q_p = 0, Q_ψ = M cos r cos p.
- Counter-rotation: the propellers turn in opposite directions, so that M = κ (F_f − F_b).
- Gyroscopic torque of the rotors' angular momentum H = k (V_f + V_b) n: −ω × H, i.e.
  Q_r = −H cos p ω_a, Q_p = −H ω_b, Q_ψ = −H sin r ω_b + H cos r sin p ω_a (it does no work).
"""

from __future__ import annotations

import math

from ..plant_effects import Row, kernel
from ..plant_layout import (
    F_BACK,
    F_FRONT,
    L_A,
    L_H,
    P_DOT,
    PSI_DOT,
    R_DOT,
    REST,
    V_BACK,
    V_FRONT,
    A,
    B,
    P,
    R,
    Stage,
)
from .base import Effect, Parameter


@kernel
def ground_effect(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    middle = body[L_A] * (math.sin(s[R]) - math.sin(body[REST]))
    for i in range(2):
        side = 1.0 if i == 0 else -1.0
        height = middle + side * body[L_H] * math.sin(s[P]) * math.cos(s[R])
        out[i] *= 1 + par[A] * math.exp(-max(0.0, height) / par[B])


@kernel
def inflow(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    arm = math.cos(s[P]) * s[R_DOT] - math.cos(s[R]) * math.sin(s[P]) * s[PSI_DOT]
    tilt = s[P_DOT] + math.sin(s[R]) * s[PSI_DOT]
    for i in range(2):
        side = 1.0 if i == 0 else -1.0
        v_n = body[L_A] * arm + side * body[L_H] * tilt
        out[i] *= min(2.0, max(0.0, 1 - par[A] * v_n))


@kernel
def reaction_torque(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    twist = par[A] * (s[F_FRONT] + s[F_BACK])
    out[0] += twist * math.sin(s[P])
    out[2] += twist * math.cos(s[R]) * math.cos(s[P])


@kernel
def counter_rotation(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    twist = par[A] * (s[F_FRONT] - s[F_BACK])
    out[0] += twist * math.sin(s[P])
    out[2] += twist * math.cos(s[R]) * math.cos(s[P])


@kernel
def gyroscopic(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    H = par[A] * (s[V_FRONT] + s[V_BACK])
    sr, cr, sp, cp = math.sin(s[R]), math.cos(s[R]), math.sin(s[P]), math.cos(s[P])
    w_a = s[P_DOT] + sr * s[PSI_DOT]
    w_b = -cp * s[R_DOT] + cr * sp * s[PSI_DOT]
    out[0] -= H * cp * w_a
    out[1] -= H * w_b
    out[2] += H * (cr * sp * w_a - sr * w_b)


EFFECTS = (
    Effect(
        name="aero.ground_effect",
        summary="More thrust near the table: F (1 + a exp(−h/h₀)).",
        parameters=(
            Parameter("thrust_share", "–", 0.0, 1.0, "a, at the table"),
            Parameter("height_m", "m", 0.01, 1.0, "h₀", default=0.1),
        ),
        example="aero.ground_effect:0.2@0.1",
        kernels={Stage.THRUST: ground_effect},
        order=1,
    ),
    Effect(
        name="aero.inflow",
        summary="Less thrust where a rotor moves along its axis: F (1 − k v_n).",
        parameters=(Parameter("loss_s_per_m", "s/m", 0.0, 2.0, "k"),),
        example="aero.inflow:0.3",
        kernels={Stage.THRUST: inflow},
        order=2,
    ),
    Effect(
        name="aero.reaction_torque",
        summary="The propellers' torque κF on the body about its normal.",
        parameters=(Parameter("torque_per_thrust_m", "m", -0.2, 0.2, "κ, N·m per N"),),
        example="aero.reaction_torque:0.02",
        kernels={Stage.TORQUE: reaction_torque},
    ),
    Effect(
        name="aero.counter_rotation",
        summary="The torque κ (F_f − F_b) of opposite propellers on the body about its normal.",
        parameters=(Parameter("torque_per_thrust_m", "m", -0.2, 0.2, "κ, N·m per N"),),
        example="aero.counter_rotation:0.02",
        kernels={Stage.TORQUE: counter_rotation},
    ),
    Effect(
        name="aero.gyroscopic",
        summary="The gyroscopic torque of the propellers' angular momentum: −ω × H.",
        parameters=(Parameter("momentum_Nms_per_V", "N·m·s/V", -0.05, 0.05, "k"),),
        example="aero.gyroscopic:0.001",
        kernels={Stage.TORQUE: gyroscopic},
    ),
)
