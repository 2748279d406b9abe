"""Adapter of PySINDy's discrepancy recipe: sparse regression of a model's acceleration errors.

Kaheman, Kaiser, Strom, Kutz and Brunton, "Learning discrepancy models from experimental data"
(2019): the residual between measured accelerations and the known model's is regressed on a
library of candidate functions by STLSQ. Here in torques, so that one column is one effect:

    S J_i (q̈_i − q̈_i,nominal) = Σ_j θ_ij S φ_ij(q, q̇, V)            i = roll, pitch, yaw

S is a Savitzky–Golay filter, twice: the manual's "Practical tips" smooth noisy data before they
are differenced (`SmoothedFiniteDifference`: once for rates, once more for accelerations). The same
S acts on the right-hand side, so its effect on both is equal. Columns have norm 1, and alpha is the
manual's. The threshold is scanned: the sparsest model within a standard error of the best in
cross-validation over blocks of time.

The adapter helps the recipe in five ways:

- the base (thrust gain and gravity, `BASE`) is refitted with every candidate; a base parameter
  beyond the profile's tolerance is reported
- a column whose coefficient has an impossible sign is removed
- lost samples are interpolated
- nearly proportional columns count as confounded (`pysindy_library`)
- the filter's window and `LEAST` were chosen on flights with known effects (seeds from 1000 on)
"""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tests.bench.peers.interface import Task, read_task
from tests.bench.peers.pysindy_library import (
    AXES,
    BASE,
    EITHER_SIGN,
    NEGATIVE,
    TIES,
    accelerations,
    columns,
    known,
)

WINDOW_S = 0.4
RATE_WINDOW_S = 0.1
EVERY = 10
EDGE_S = 1.0
THRESHOLDS = np.geomspace(0.01, 0.6, 18)
"""Scanned thresholds of STLSQ: smallest coefficient, with target and columns scaled to norm 1"""
ALPHA = 0.05
BLOCKS = 5
TOLERANCE, SURE = 0.15, 3.0
LEAST = 0.45
"""Smallest share of the target's norm that a reported effect must have. Without it 7 of 8
`run-step` flights with no effect name a lag (shares up to 0.41; none of 12 rich ones, 8 steps)."""
INSIDE = 1e-3
"""A column with a smaller share of its norm outside the base's span is confounded with the base"""

Finding = dict[str, Any]


def even(task: Task) -> Task:
    """Returns the task on an even clock: lost and late samples interpolated, voltages held."""
    t = np.arange(task.t[0], task.t[-1], task.dt)
    angle = np.column_stack([np.interp(t, task.t, a) for a in task.angle.T])
    held = np.searchsorted(task.t, t + 1e-9, side="right") - 1
    return Task(
        t, task.voltage[held], angle, task.nominal, task.known, task.rad_per_count,
        task.acceleration_noise,
    )  # fmt: skip


def difference(x: np.ndarray, t: np.ndarray, window_s: float) -> np.ndarray:
    import pysindy as ps

    smooth = ps.SmoothedFiniteDifference(smoother_kws={"window_length": odd(window_s, t)})
    return np.asarray(smooth(x, t))


def odd(window_s: float, t: np.ndarray) -> int:
    return 2 * round(window_s / float(t[1] - t[0]) / 2) + 1


def smoothed(x: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Returns S x, x smoothed twice, on the rows of `kept`."""
    from scipy.signal import savgol_filter

    for _ in range(2):
        x = savgol_filter(x, odd(WINDOW_S, t), 3, axis=0)
    return kept(x, t)


def kept(x: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Returns every `EVERY`-th row, without `EDGE_S` at both ends."""
    edge = round(EDGE_S / float(t[1] - t[0]))
    return np.asarray(x[edge:-edge:EVERY])


def regression(task: Task) -> list[tuple[np.ndarray, dict[str, np.ndarray]]]:
    """Returns for each axis the torque that the nominal model lacks, and the library's, in N·m."""
    task = even(task)
    t, q = task.t, task.angle
    w = difference(q, t, RATE_WINDOW_S)
    a = kept(difference(difference(q, t, WINDOW_S), t, WINDOW_S), t)
    # Voltage k is held from k to k + 1: around sample k, half of it is the one before.
    V = 0.5 * (task.voltage + np.vstack([task.voltage[:1], task.voltage[:-1]]))
    lack = a - smoothed(accelerations(q, w, V, task), t)
    J = [known(task)[name] for name in ("J_r", "J_p", "J_y")]
    return [
        (J[i] * lack[:, i], {name: smoothed(x, t) for name, x in library.items()})
        for i, library in enumerate(columns(q, w, V, task))
    ]


def orthogonal_to_base(
    y: np.ndarray, library: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Returns target and candidates without their components in the span of the base."""
    Q, _ = np.linalg.qr(np.column_stack([library[name] for name in BASE if name in library]))
    rest = {}
    for name, x in library.items():
        left = x - Q @ (Q.T @ x)
        if name not in BASE and left @ left > INSIDE**2 * (x @ x):
            rest[name] = left
    return y - Q @ (Q.T @ y), rest


def refits(
    y: np.ndarray, library: Mapping[str, np.ndarray], found: Collection[str]
) -> list[dict[str, float]]:
    """Returns the base's coefficients, fitted with the effects found.

    The first are those of all rows, the others those without one block of time each (jackknife).
    """
    names = [name for name in library if name in BASE or name in found]
    X = np.column_stack([library[name] for name in names])
    rows = np.arange(len(y))
    some = [rows, *(np.setdiff1d(rows, held) for held in np.array_split(rows, BLOCKS))]
    return [dict(zip(names, np.linalg.lstsq(X[k], y[k])[0].tolist(), strict=True)) for k in some]


def unit(x: np.ndarray) -> np.ndarray:
    """Returns x scaled to norm 1, so that a coefficient is its column's share of the target."""
    return np.asarray(x / np.linalg.norm(x, axis=0))


def stlsq(X: np.ndarray, y: np.ndarray, threshold: float) -> np.ndarray:
    import pysindy as ps

    optimizer = ps.STLSQ(threshold=threshold, alpha=ALPHA)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "sparsity parameter is too big": nothing found
        optimizer.fit(X, y[:, None])
    return np.asarray(optimizer.coef_)[0]


def scanned(X: np.ndarray, y: np.ndarray) -> float:
    """Returns the threshold of the sparsest model within a standard error of the best.

    The errors are those of cross-validation over blocks of time.
    """
    errors = []
    for held in np.array_split(np.arange(len(y)), BLOCKS):
        rest = np.setdiff1d(np.arange(len(y)), held)
        errors.append([float(((y - X @ stlsq(X[rest], y[rest], t))[held] ** 2).mean())
                       for t in THRESHOLDS])  # fmt: skip
    E = np.array(errors)
    mean, spread = E.mean(axis=0), E.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    best = int(mean.argmin())
    return float(THRESHOLDS[np.flatnonzero(mean <= mean[best] + spread[best]).max()])


def sparse(y: np.ndarray, library: Mapping[str, np.ndarray]) -> dict[str, tuple[float, float]]:
    """Returns name → coefficient (N·m per unit) and its share of the target.

    Columns with an impossible sign are removed from the library, and the rest is refitted.
    """
    names = list(library)
    while names:
        X = np.column_stack([library[name] for name in names])
        U, v = unit(X), unit(y)
        c = stlsq(U, v, scanned(U, v))
        wrong = [n for n, x in zip(names, c, strict=True) if x < 0 and n not in EITHER_SIGN]
        if not wrong:
            size = np.linalg.norm(y) / np.linalg.norm(X, axis=0)
            return {
                n: (float(x * k), float(abs(x)))
                for n, x, k in zip(names, c, size, strict=True)
                if abs(x) > LEAST
            }
        names = [n for n in names if n not in wrong]
    return {}


def ratios(refit: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Returns K_f, inertias and T_g over their nominal values, from the base coefficients.

    With index 0 for nominal values, 1 + gain_i = (K_f/K_f,0)(J_i,0/J_i) for axis i and
    1 + gravity = (T_g/T_g,0)(J_r,0/J_r); K_f is the median over the three axes.
    """
    gain = np.array([1 + axis["base.gain"] for axis in refit])
    K = float(np.median(gain))
    out = {"motor.thrust_gain": K}
    out |= {f"inertia.{a}": K / float(g) for a, g in zip(AXES, gain, strict=True)}
    return out | {"mass.imbalance": (1 + refit[0]["base.gravity"]) * out["inertia.roll"]}


def calibrated(of_axes: Sequence[Sequence[Mapping[str, float]]]) -> list[Finding]:
    """Returns base parameters off by more than the tolerance and `SURE` jackknife errors."""
    whole, *without = [ratios(refit) for refit in zip(*of_axes, strict=True)]
    out = []
    for name, ratio in whole.items():
        d = np.array([w[name] for w in without]) - ratio
        error = float(np.sqrt((BLOCKS - 1) / BLOCKS * (d @ d)))
        if abs(ratio - 1) > TOLERANCE + SURE * error:
            out.append(finding(name, ratio, abs(ratio - 1) / TOLERANCE))
    return out


def finding(name: str, value: float, strength: float) -> Finding:
    if value < 0 and name in NEGATIVE:
        name, tied = NEGATIVE[name], []
    else:
        tied = TIES.get(name, [])
    head, _, last = name.rpartition(".")
    effect, axis = (head, last) if last in AXES else (name, None)
    return {
        "effect": effect, "axis": axis, "parameters": {}, "score": strength,
        "coefficient": value, "tied_with": tied,
    }  # fmt: skip


def discrepancy(task: Task) -> dict[str, object]:
    """Returns the findings in the form of ``diagnose --json``, as far as this recipe has them."""
    base, strongest = [], dict[str, tuple[float, float]]()
    for y, library in regression(task):
        result = sparse(*orthogonal_to_base(y, library))
        base.append(refits(y, library, result))
        for name, (value, share) in result.items():
            if share > strongest.get(name, (0.0, 0.0))[1]:
                strongest[name] = (value, share)
    groups = (calibrated(base), [finding(name, *f) for name, f in strongest.items()])
    findings = [f for group in groups for f in sorted(group, key=lambda f: -f["score"])]
    return {
        "verdict": "explained" if findings else "nothing_found",
        "findings": findings,
        "leftover": [],
    }


def main(task_file: str, found_file: str) -> None:
    result = discrepancy(read_task(Path(task_file)))
    Path(found_file).write_text(json.dumps(result), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
