"""Library for PySINDy's discrepancy recipe: one column of torque for each candidate effect.

A column is the torque (N·m) on an axis of an effect of unit size, from angles q = (r, p, ψ), rates
and voltages. Signs are those of rig.md; F = K_f (V_f + V_b), D = K_f (V_f − V_b). The base is::

    roll   L_a cos p F           − T_g cos r
    pitch  L_h D
    yaw    −L_a cos r sin p F

A voltage change ΔV changes F and D, so it acts on all three axes. Nearly proportional columns are
merged into one: lag and delay, dry friction and backlash, a pitch offset and the reaction torque.
As separate columns they got large opposite coefficients on every flight. A thrust curve and a
sagging supply are one column with opposite signs. Limits, mass changes, lost samples and periodic
torques of unknown frequency have no column: they are no function of the state with one coefficient.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from tests.bench.peers import rigid
from tests.bench.peers.interface import Task

AXES = ("roll", "pitch", "yaw")
BASE = ("base.gain", "base.gravity")
"""Columns for errors of the base: refitted with every candidate, reported only beyond tolerance"""
LAG_S, STICK_RAD_S, HEIGHT_M, REST_RAD = 0.03, 0.02, 0.1, np.radians(-27.5)

TIES = {
    "motor.thrust_curve": ["motor.dead_zone"],
    "motor.lag": ["motor.delay"],
    "aero.reaction_torque": ["encoder.offset.pitch"],
    "stiffness.pendulum.roll": ["encoder.offset.roll"],
    **{f"friction.coulomb.{axis}": [f"encoder.backlash.{axis}"] for axis in AXES},
}
"""Column → the other effects that it stands for"""
NEGATIVE = {"motor.thrust_curve": "motor.supply_sag", "stiffness.pendulum.roll":
            "encoder.offset.roll"}  # fmt: skip
"""Column → the effect that a negative coefficient means, if it is another than a positive one's"""
EITHER_SIGN = frozenset(
    {"bias.torque.pitch", "bias.torque.yaw", "motor.thrust_mismatch", "aero.reaction_torque",
     "aero.gyroscopic"} | set(NEGATIVE)
)  # fmt: skip
"""Columns whose coefficient may have either sign; those of all others must be positive"""


def known(task: Task) -> dict[str, float]:
    """Returns the profile's numbers by the names in `rigid.NAMES` and `rigid.KNOWN`."""
    names = (*rigid.NAMES, *rigid.KNOWN)
    return dict(zip(names, [*task.nominal.tolist(), *task.known.tolist()], strict=True))


def accelerations(q: np.ndarray, w: np.ndarray, V: np.ndarray, task: Task) -> np.ndarray:
    """Returns (N, 3) rad/s² of the profile's rigid body without lag, friction or stiffness."""
    of = known(task)
    values = [of[n] if n in ("J_r", "J_p", "J_y", "T_g") else 0.0 for n in rigid.NAMES[:-1]]
    P = (*values, 1.0, *task.known.tolist())
    f = of["K_f"] * V - of["T_g"] / (2 * of["L_a"])
    rows = [
        rigid.derivative(*a, *b, *c, 0.0, 0.0, P)[3:6]
        for a, b, c in zip(q.tolist(), w.tolist(), f.tolist(), strict=True)
    ]
    return np.array(rows)


def columns(
    q: np.ndarray, w: np.ndarray, V: np.ndarray, task: Task
) -> tuple[dict[str, np.ndarray], ...]:
    """Returns for each axis name → torque (N,) in N·m.

    q (N, 3) rad, w (N, 3) rad/s and V (N, 2) V are sampled every ``task.dt``.
    """
    of = known(task)
    L_a, L_h, K_f, V_o = of["L_a"], of["L_h"], of["K_f"], of["T_g"] / (2 * of["L_a"] * of["K_f"])
    r, p, psi = q.T
    F = K_f * V.sum(axis=1)

    def by_voltage(dV: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        dF, dD = K_f * dV.sum(axis=1), K_f * (dV[:, 0] - dV[:, 1])
        return L_a * np.cos(p) * dF, L_h * dD, -L_a * np.cos(r) * np.sin(p) * dF

    k = 1 - np.exp(-task.dt / LAG_S)
    lagged = V[0] + lfilter([k], [1, k - 1], V - V[0], axis=0)
    height = L_a * (np.sin(r) - np.sin(REST_RAD))
    gain, lag = by_voltage(V), by_voltage(lagged - V)
    curve = by_voltage(V * np.abs(V) / abs(V_o) - V)
    roll = {
        "base.gravity": -of["T_g"] * np.cos(r),
        "stiffness.pendulum.roll": -np.sin(r),
        "aero.ground_effect": by_voltage(V * np.exp(-height / HEIGHT_M)[:, None])[0],
        "aero.inflow": by_voltage(-V * (L_a * w[:, :1]))[0],
    }
    pitch = {
        "bias.torque.pitch": np.ones_like(p),
        "stiffness.pendulum.pitch": -np.sin(p),
        "motor.thrust_mismatch": by_voltage(0.5 * V * np.array([1.0, -1.0]))[1],
        "aero.gyroscopic": V.sum(axis=1) * w[:, 0],
    }
    yaw = {
        "bias.torque.yaw": np.ones_like(p),
        "stiffness.cable.yaw": -psi,
        "aero.reaction_torque": F * np.cos(r) * np.cos(p),
    }
    return tuple(
        {
            "base.gain": gain[i],
            "motor.lag": lag[i],
            "motor.thrust_curve": curve[i],
            f"friction.coulomb.{axis}": -np.tanh(w[:, i] / STICK_RAD_S),
            f"friction.viscous.{axis}": -w[:, i],
            f"drag.quadratic.{axis}": -w[:, i] * np.abs(w[:, i]),
            **own,
        }
        for i, (axis, own) in enumerate(zip(AXES, (roll, pitch, yaw), strict=True))
    )
