"""Find a residual torque that depends on a variable, from a multi-step fit's errors in weak form.

The errors in weak form (`heli3dof.identification.greybox.weak_form`) are mean residual
accelerations over time spans of `SPANS_S[0]`. Multiplied by the axis' inertia J, they are residual
torques τ, one for each span and axis. For each variable, a piecewise linear curve τ̂ with
`CURVE_KNOTS` knots predicts τ from the variable's mean over the span. Ridge regression fits the
curve to every other block of `WINDOW_S`; the remaining blocks test it. Then the two sets of blocks
change roles.

    share = 1 − Σ (τ − τ̂)² / Σ (τ − τ̄)²      over the test spans; τ̄: mean of the training spans

The result for an axis is the variable with the largest share of explained variance. This share must
be at least `LEAST`, and its bootstrap interval over blocks must lie above zero. ``also`` lists the
variables with more than `NEARLY` times this share. Coloured residuals and the choice of the best
variable raise the false-alarm rate above 5 %: the result is a hint, not a cause.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.diagnosis.validation.gain import interval
from heli3dof.identification.greybox.multistep import WINDOW_S, MultiStepFit
from heli3dof.identification.greybox.weak_form import SmoothedFlight, residuals, smoothed_flight

CURVE_KNOTS = 5
RIDGE = 1.0
LEAST = 0.10
NEARLY = 0.8
SHARE_DRAWS = 500
"""Chosen; not derived: knots, ridge penalty, limits of the share, bootstrap draws"""
VARIABLES = (*AXES, *(f"{a}_rate" for a in AXES), "voltage_sum", "voltage_difference", "time")


def residual_torques(fit: MultiStepFit) -> tuple[ResidualTorque, ...]:
    """Return at most one residual torque per axis, the largest share of explained variance first.

    The share is computed on test spans, to which the torque's curve was not fitted. ``score`` is
    the share times the number of spans. ``confidence`` is the fraction of bootstrap samples with a
    positive share.
    """
    logs = [smoothed_flight(f) for f in fit.problem.flights]
    e = residuals(fit.problem, logs, fit.z)[0]
    rows, t, x = _spans(logs)
    J = fit.values[1:4]
    found = []
    for i, axis in enumerate(AXES):
        torque = e[rows, i] * J[i]
        shares = {name: _cross_validated_share(torque, z, t) for name, z in x.items()}
        best = max(shares, key=lambda n: shares[n][0])
        share, low, confidence = shares[best]
        if share < LEAST or low <= 0:
            continue
        also = sorted(
            (n for n in shares if n != best and shares[n][0] > NEARLY * share),
            key=lambda n: -shares[n][0],
        )
        knots, curve, std = _curve(torque, x[best])
        found.append(
            ResidualTorque(
                axis, best, share, tuple(zip(knots.tolist(), curve.tolist(), strict=True)),
                tuple(std.tolist()), float(share * len(torque)), confidence, tuple(also),
            )
        )  # fmt: skip
    return tuple(sorted(found, key=lambda f: -f.share))


def _spans(logs: list[SmoothedFlight]) -> tuple[np.ndarray, np.ndarray, dict[str, np.ndarray]]:
    """Select time spans that do not overlap; return (rows, times in s, {variable: means}).

    `residuals` returns one row for each time span of `SPANS_S[0]` seconds, but these spans overlap.
    "rows" are the indices of the selected spans among these rows. "times" are the middles of the
    selected spans. "means" are the means of a variable over each selected span. The times of
    recording n are increased by n · 10⁴ s, to separate the recordings.
    """
    rows, t, means, at = [], [], [], 0
    for n, log in enumerate(logs):
        first, L, V = log.spans[0].rows, len(log.spans[0].phi), log.flight.V
        keep, free = [], -1
        for i, k in enumerate(first):
            if k >= free:
                keep.append(i)
                free = k + L
        x = np.column_stack(
            [log.y_smooth, log.y_dot, V.sum(axis=1), V[:, 0] - V[:, 1], log.flight.t]
        )
        mean = x[np.add.outer(first[keep], np.arange(L))].mean(axis=1)
        rows.append(np.array(keep) + at)
        t.append(mean[:, -1] + 1e4 * n)
        means.append(mean)
        at += len(first)
    by_variable = dict(zip(VARIABLES, np.concatenate(means).T, strict=True))
    return np.concatenate(rows), np.concatenate(t), by_variable


def _hats(z: np.ndarray, knots: np.ndarray) -> np.ndarray:
    return np.array([np.interp(z, knots, e) for e in np.eye(len(knots))]).T


def _knots(z: np.ndarray) -> np.ndarray:
    k = np.unique(np.quantile(z, np.linspace(0.03, 0.97, CURVE_KNOTS)))
    return k if len(k) > 1 else np.array([z.min(), z.min() + 1.0])


def _solve(A: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    H = A.T @ A + RIDGE * np.eye(A.shape[1])
    return np.linalg.solve(H, A.T @ y), np.linalg.inv(H)


def _cross_validated_share(
    y: np.ndarray, z: np.ndarray, t: np.ndarray
) -> tuple[float, float, float]:
    """Return the share of the torque's variance that a variable explains on test spans.

    The result is (share, lower end of its bootstrap interval, confidence). The confidence is the
    fraction of bootstrap samples with a positive share. For each of n time spans, ``y`` (n,) is the
    torque in N·m, ``z`` (n,) the variable and ``t`` (n,) the time in s.
    """
    block = np.floor(t / WINDOW_S).astype(int)
    knots = _knots(z)
    A = _hats(z, knots)
    explained, total = np.zeros(len(y)), np.zeros(len(y))
    for side in (0, 1):
        test = block % 2 == side
        if test.all() or not test.any():
            return 0.0, 0.0, 0.0
        mean = y[~test].mean()
        c, _ = _solve(A[~test], y[~test] - mean)
        total[test] = (y[test] - mean) ** 2
        explained[test] = total[test] - (y[test] - mean - A[test] @ c) ** 2
    _, k = np.unique(block, return_inverse=True)
    W, T = np.bincount(k, explained), np.bincount(k, total)
    drawn = np.random.default_rng(3).integers(0, len(W), (SHARE_DRAWS, len(W)))
    draws = W[drawn].sum(axis=1) / T[drawn].sum(axis=1)
    return float(W.sum() / T.sum()), interval(draws)[0], float((draws > 0).mean())


def _curve(y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit a piecewise linear curve to torques y (n,) in N·m against a variable's values z (n,).

    The result is (knots, torque at each knot, its standard deviation).
    """
    knots = _knots(z)
    A = _hats(z, knots)
    c, C = _solve(A, y - y.mean())
    s2 = float(np.var(y - y.mean() - A @ c))
    return knots, c, np.sqrt(s2 * np.diag(C))
