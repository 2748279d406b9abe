"""PySINDy's discrepancy recipe: sparse regression of what the nominal model's accelerations lack.

Kaheman, Kaiser, Strom, Kutz and Brunton, "Learning discrepancy models from experimental data"
(2019): the residual between measured accelerations and the known model's is regressed on a
library of candidate functions by STLSQ. Here in torques, so that one column is one effect:

    J_i (q̈_i − q̈_i,nominal) = Σ_j θ_ij φ_ij(q, q̇, V)            i = roll, pitch, yaw

The settings are those of the manual's "Practical tips": Savitzky–Golay smoothing before
differences (``SmoothedFiniteDifference``), columns normalised, and the threshold scanned with the
sparsest model within one standard error of the best in cross-validation over blocks of time.

Kindnesses: what the base itself may be off by (an axis' thrust gain over its inertia, gravity's
torque) is in the library and is no finding (an inertia's own q̈ beside it would fit anything); an
effect on several axes needs its column on one of them. Columns that are nearly one another's
multiples (thrust curve, supply sag and dead zone; lag and delay; pitch offset and reaction torque;
Coulomb friction and backlash) are one column, which is then named as a tie: with all of them in,
every flight had large opposite coefficients. Timing, limits, mass changes and periodic torques of
unknown frequency have no column: the recipe has no place for them.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.bench.peers import rigid
from tests.bench.peers.interface import Task, read_task

WINDOW_S = 0.1
EVERY = 5
"""Rows: columns at 100 Hz; smoothed over 0.1 s there is nothing more in 500."""
EDGE_S = 0.5
TAKEN_OFF_RAD = np.radians(-20.0)
THRESHOLDS = np.geomspace(0.01, 0.6, 18)
"""Of coefficients of normalised columns for a normalised target: its standard deviation's share."""
ALPHA = 0.01
BLOCKS = 5
BASE = "base"
AXES = ("roll", "pitch", "yaw")
LAG_S, STICK_RAD_S, HEIGHT_M, REST_RAD = 0.03, 0.01, 0.1, np.radians(-27.5)

ONE_COLUMN = {
    "motor.thrust_curve": ["motor.supply_sag", "motor.dead_zone"],
    "motor.lag": ["motor.delay"],
    "aero.reaction_torque": ["encoder.offset.pitch"],
    **{f"friction.coulomb.{axis}": [f"encoder.backlash.{axis}"] for axis in AXES},
}

Library = tuple[list[str], np.ndarray]


def motion(task: Task) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Smoothed angles, rates, accelerations (N, 3) in rad and s, and voltages (N, 2), in flight."""
    import pysindy as ps

    window = 2 * round(WINDOW_S / task.dt / 2) + 1
    difference = ps.SmoothedFiniteDifference(smoother_kws={"window_length": window})
    rate = np.asarray(difference(task.angle, task.t))
    acceleration = np.asarray(difference(rate, task.t))
    # Accelerations went through the filter twice: so does everything beside them.
    rate, angle = smoothed(rate, window), smoothed(smoothed(task.angle, window), window)
    # Held from k to k + 1: at sample k half of it is the one before.
    held = 0.5 * (task.voltage + np.vstack([task.voltage[:1], task.voltage[:-1]]))
    voltage = smoothed(smoothed(held, window), window)
    flying = np.flatnonzero(task.angle[:, 0] > TAKEN_OFF_RAD)
    edge = round(EDGE_S / task.dt)
    rows = slice(flying[0] + edge, flying[-1] - edge, EVERY)
    return angle[rows], rate[rows], acceleration[rows], voltage[rows]


def smoothed(x: np.ndarray, window: int) -> np.ndarray:
    """As the angles are: the same filter on both sides of the equation."""
    from scipy.signal import savgol_filter

    return np.asarray(savgol_filter(x, window, 3, axis=0))


def nominal(
    q: np.ndarray, w: np.ndarray, V: np.ndarray, task: Task
) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) accelerations of the profile's rigid body, and (3,) its inertias."""
    start = dict(zip(rigid.NAMES, task.nominal.tolist(), strict=True))
    values = [start[n] if n in ("J_r", "J_p", "J_y", "T_g") else 0.0 for n in rigid.NAMES[:-1]]
    P = (*values, 1.0, *task.known.tolist())
    L_a, _, K_f = task.known
    f = K_f * V - start["T_g"] / (2 * L_a)
    rows = [
        rigid.derivative(*a, *b, *c, 0.0, 0.0, P)[3:6]
        for a, b, c in zip(q.tolist(), w.tolist(), f.tolist(), strict=True)
    ]
    return np.array(rows), np.array([start["J_r"], start["J_p"], start["J_y"]])


def library(q: np.ndarray, w: np.ndarray, V: np.ndarray, task: Task) -> list[Library]:
    """For each axis names and columns (N, n): torques of candidate effects."""
    L_a, L_h, K_f = task.known
    r, p, psi = q.T
    F = K_f * V.sum(axis=1)
    V_dot = np.gradient(V, EVERY * task.dt, axis=0)
    T_g = dict(zip(rigid.NAMES, task.nominal.tolist(), strict=True))["T_g"]
    V_o = T_g / (2 * L_a * K_f)

    def by_thrust(dV: np.ndarray) -> list[np.ndarray]:
        """What a change of both voltages does on the three axes."""
        dF, dD = K_f * dV.sum(axis=1), K_f * (dV[:, 0] - dV[:, 1])
        return [L_a * np.cos(p) * dF, L_h * dD, -L_a * np.cos(r) * np.sin(p) * dF]

    height = L_a * (np.sin(r) - np.sin(REST_RAD))
    v_n = L_a * w[:, 0]
    H = V.sum(axis=1)
    gain, lag = by_thrust(V), by_thrust(-LAG_S * V_dot)
    roll = {
        f"{BASE}.gravity": np.cos(r),
        "stiffness.pendulum.roll": -np.sin(r),
        "motor.thrust_curve": by_thrust(V * np.abs(V) / abs(V_o) - V)[0],
        "aero.ground_effect": by_thrust(V * np.exp(-height / HEIGHT_M)[:, None])[0],
        "aero.inflow": by_thrust(-V * v_n[:, None])[0],
    }
    pitch = {
        "bias.torque.pitch": np.ones_like(p),
        "stiffness.pendulum.pitch": -np.sin(p),
        "motor.thrust_mismatch": by_thrust(0.5 * V * np.array([1.0, -1.0]))[1],
        "aero.gyroscopic": H * w[:, 0],
    }
    yaw = {
        "bias.torque.yaw": np.ones_like(p),
        "stiffness.cable.yaw": -psi,
        "aero.reaction_torque": F * np.cos(r) * np.cos(p),
    }
    out = []
    for i, (axis, own) in enumerate(zip(AXES, (roll, pitch, yaw), strict=True)):
        columns = {
            f"{BASE}.gain": gain[i],
            "motor.lag": lag[i],
            f"friction.coulomb.{axis}": -np.tanh(w[:, i] / STICK_RAD_S),
            f"friction.viscous.{axis}": -w[:, i],
            f"drag.quadratic.{axis}": -w[:, i] * np.abs(w[:, i]),
            **own,
        }
        kept = {n: c for n, c in columns.items() if np.sqrt((c**2).mean()) > 1e-9}
        out.append((list(kept), np.column_stack(list(kept.values()))))
    return out


def sparse(X: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, float]:
    """Coefficients of normalised columns, and the threshold that cross-validation chose."""
    errors = []
    blocks = np.array_split(np.arange(len(y)), BLOCKS)
    for held in blocks:
        rest = np.setdiff1d(np.arange(len(y)), held)
        errors.append([float(((y - X @ fitted(X[rest], y[rest], t))[held] ** 2).mean())
                       for t in THRESHOLDS])  # fmt: skip
    E = np.array(errors)
    mean, spread = E.mean(axis=0), E.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    best = int(mean.argmin())
    within = np.flatnonzero(mean <= mean[best] + spread[best])
    threshold = float(THRESHOLDS[within.max()])
    return fitted(X, y, threshold), threshold


def fitted(X: np.ndarray, y: np.ndarray, threshold: float) -> np.ndarray:
    import pysindy as ps

    optimizer = ps.STLSQ(threshold=threshold, alpha=ALPHA)
    optimizer.fit(X, y[:, None])
    return np.asarray(optimizer.coef_)[0]


def discrepancy(task: Task) -> dict[str, object]:
    """A document as the contract's, as far as this recipe can fill one."""
    q, w, a, V = motion(task)
    model, J = nominal(q, w, V, task)
    strength: dict[str, float] = {}
    value: dict[str, float] = {}
    thresholds = []
    for i, (names, X) in enumerate(library(q, w, V, task)):
        y = J[i] * (a - model)[:, i]
        size, scale = float(y.std()), np.sqrt((X**2).mean(axis=0))
        coefficients, threshold = sparse(X / scale, y / size)
        thresholds.append(threshold)
        for name, c, s in zip(names, coefficients, scale, strict=True):
            share = float(abs(c))
            if not name.startswith(BASE) and share > strength.get(name, 0.0):
                strength[name], value[name] = share, float(c * size / s)
    return document(strength, value, thresholds)


def document(
    strength: Mapping[str, float], value: Mapping[str, float], thresholds: list[float]
) -> dict[str, object]:
    findings = []
    for name in sorted(strength, key=lambda n: -strength[n]):
        head, _, last = name.rpartition(".")
        effect, axis = (head, last) if last in AXES else (name, None)
        findings.append(
            {"effect": effect, "axis": axis, "parameters": {}, "score": strength[name],
             "coefficient": value[name], "tied_with": ONE_COLUMN.get(name, [])}
        )  # fmt: skip
    return {
        "verdict": "explained" if findings else "nothing_found",
        "findings": findings,
        "leftover": [],
        "about": {"thresholds": thresholds},
    }


def main(task_file: str, found_file: str) -> None:
    found = discrepancy(read_task(Path(task_file)))
    Path(found_file).write_text(json.dumps(found), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
