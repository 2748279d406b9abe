"""Torques without a model in the diagnosis, to test that it reports an unmodelled effect.

r, p, ψ are roll, pitch and yaw in rad, V_f and V_b the motor voltages; k is the parameter:

- ``other.yaw_torque_from_pitch_rate``: −k ṗ on yaw;
- ``other.roll_torque_from_yaw_angle``: k sin ψ on roll (as on a tilted base);
- ``other.pitch_torque_from_voltage_product``: k V_f V_b on pitch (as if the wakes interacted);
- ``other.yaw_torque_from_roll_rate_squared``: k ṙ |ṙ| on yaw.
"""

from __future__ import annotations

import math

from ..plant_effects import Row, kernel
from ..plant_layout import P_DOT, PSI, R_DOT, V_BACK, V_FRONT, A, Stage
from .base import Effect, Parameter


@kernel
def yaw_from_pitch_rate(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[2] -= par[A] * s[P_DOT]


@kernel
def roll_from_yaw(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[0] += par[A] * math.sin(s[PSI])


@kernel
def pitch_from_product(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[1] += par[A] * s[V_FRONT] * s[V_BACK]


@kernel
def yaw_from_roll_rate(s: Row, body: Row, par: Row, mem: Row, out: Row) -> None:
    out[2] += par[A] * s[R_DOT] * abs(s[R_DOT])


EFFECTS = (
    Effect(
        name="other.yaw_torque_from_pitch_rate",
        summary="Outside the catalogue: −k ṗ on yaw.",
        parameters=(Parameter("damping_Nms_per_rad", "N·m·s/rad", -2.0, 2.0, "k"),),
        example="other.yaw_torque_from_pitch_rate:0.1",
        kernels={Stage.TORQUE: yaw_from_pitch_rate},
    ),
    Effect(
        name="other.roll_torque_from_yaw_angle",
        summary="Outside the catalogue: k sin ψ on roll, as on a tilted base.",
        parameters=(Parameter("torque_Nm", "N·m", -1.0, 1.0, "k"),),
        example="other.roll_torque_from_yaw_angle:0.1",
        kernels={Stage.TORQUE: roll_from_yaw},
    ),
    Effect(
        name="other.pitch_torque_from_voltage_product",
        summary="Outside the catalogue: k V_f V_b on pitch.",
        parameters=(Parameter("torque_Nm_per_V2", "N·m/V²", -0.01, 0.01, "k"),),
        example="other.pitch_torque_from_voltage_product:0.0005",
        kernels={Stage.TORQUE: pitch_from_product},
    ),
    Effect(
        name="other.yaw_torque_from_roll_rate_squared",
        summary="Outside the catalogue: k ṙ |ṙ| on yaw.",
        parameters=(Parameter("drag_Nms2_per_rad2", "N·m·s²/rad²", -5.0, 5.0, "k"),),
        example="other.yaw_torque_from_roll_rate_squared:0.5",
        kernels={Stage.TORQUE: yaw_from_roll_rate},
    ),
)
