"""Identify a linear controller from a log: which voltages follow from which angles?

A sampled linear controller of order n computes the motor voltages u = v − extra (V) from the angles
y (rad) and the references r (rad):

    u[k] = Σ_{j=1…n} A_j u[k−j] + Σ_{j=0…n} (B_j y[k−j] + R_j r[k−j]) + c + e[k]

The logged signals obey this law exactly, so e is zero except where the controller is not linear: in
a rate limiter, or after a voltage limit. A, B, R and c minimise Σ|e|, which such rows do not shift.
Rows with a voltage at the limit are left out. The reweighted least squares of `absolute_regression`
minimise Σ|e|.

The **share** of a block of `BLOCK_S` is std(e)/std(Δu), with Δu[k] = u[k] − u[k−1], and the larger
ratio of the two motors. A law's share is the upper quartile of the blocks. The controller is the
law of lowest order whose share is at most `SIMPLER` times the least of all orders, if that is at
most `EXPLAINED`.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.estimation.decimated_log import decimation
from heli3dof.recording.linear_controller import LinearController
from heli3dof.recording.recording import Recording

ORDERS = (1, 2, 3)
"""Orders n, lowest first. Three is the order of an integral and a second-order rate filter."""
EXPLAINED = 0.05
"""Largest share of a controller. Chosen: see the module."""
SIMPLER = 2.0
"""Largest share of a law of lower order, relative to the least share of all. Chosen."""
BLOCK_S, LEAST_ROWS, LEAST_BLOCKS = 2.0, 20, 3
"""s, length of a block; fewest rows of a block; fewest blocks. Chosen."""
AT_LIMIT = 0.98
"""Share of v_max from which a voltage counts as limited. Chosen."""
ITERATIONS, SMALLEST_V = 50, 1e-5
"""Iterations of the regression; V, errors below this have equal weights. Chosen."""


def identified_controller(recording: Recording) -> LinearController | None:
    """Return the linear controller that explains the recording's voltages; None without one.

    It needs all angles in all rows, at the control period.
    """
    r = recording
    if len(r.axes) < 3 or not np.isfinite(r.angle).all() or decimation(r) != 1:
        return None
    laws = [law for n in ORDERS if (law := law_of_order(r, n)) is not None]
    least = min((share for _, share in laws), default=np.inf)
    if least > EXPLAINED:
        return None
    return next(law for law, share in laws if share <= SIMPLER * least)


def law_of_order(r: Recording, n: int) -> tuple[LinearController, float] | None:
    """Return the law of order ``n``, and its share; None if there are too few rows."""
    extra = np.nan_to_num(r.voltage_extra)
    u, y = r.voltage - extra, r.angle - r.angle[0]
    k = np.arange(n, len(r))
    limited = (np.abs(r.voltage) >= AT_LIMIT * r.profile.motor.v_max).any(axis=1)
    k = k[~np.logical_or.reduce([limited[k - j] for j in range(n + 1)])]
    reference = np.nan_to_num(r.reference[:, [r.has_reference(a) for a in AXES]])
    columns = [u[k - j] for j in range(1, n + 1)] + [y[k - j] for j in range(n + 1)]
    columns += [reference[k - j] for j in range(n + 1)] + [np.ones((len(k), 1))]
    X = np.hstack(columns)
    if len(k) < 10 * X.shape[1]:
        return None
    theta = absolute_regression(X, u[k])
    e, change = u[k] - X @ theta, u[k] - u[k - 1]
    block = ((r.t[k] - r.t[0]) // BLOCK_S).astype(int)
    shares = []
    for own in (block == b for b in np.unique(block)):
        scale = change[own].std(axis=0)
        if own.sum() >= LEAST_ROWS and (scale > 0).all():
            shares.append(float((e[own].std(axis=0) / scale).max()))
    if len(shares) < LEAST_BLOCKS:
        return None
    A = np.array([theta[2 * j : 2 * j + 2].T for j in range(n)])
    B = np.array([theta[2 * n + 3 * j : 2 * n + 3 * j + 3].T for j in range(n + 1)])
    return LinearController(A, B), float(np.quantile(shares, 0.75))


def absolute_regression(X: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return θ (m, 2), which minimises Σ|u − X θ| for each column of u (N, 2).

    It is found by least squares with the weights 1/max(|e|, `SMALLEST_V`).
    """
    scale = np.maximum(np.abs(X).max(axis=0), 1e-12)
    X = X / scale
    theta = np.linalg.lstsq(X, u, rcond=None)[0]
    for _ in range(ITERATIONS):
        e = np.abs(u - X @ theta)
        weight = np.sqrt(1 / np.maximum(e, SMALLEST_V))
        theta = np.column_stack([
            np.linalg.lstsq(X * weight[:, i, None], u[:, i] * weight[:, i], rcond=None)[0]
            for i in range(u.shape[1])
        ])  # fmt: skip
    return np.asarray(theta / scale[:, None])
