"""Identify the controller from a log: the linear law by which the voltages follow from the angles.

A sampled linear controller of order n computes the two motor voltages u from the angles y (rad) and
the references r (rad):

    u[k] = Σ_{j=1…n} A_j u[k−j] + Σ_{j=0…n} (B_j y[k−j] + R_j r[k−j]) + c + e[k]

u (V) are the logged motor voltages minus the logged excitation. Without noise, the residual e is
zero in all rows in which the controller is linear. It is not linear where a rate limiter or clamped
integrals act. The estimates of A, B, R and c minimise Σ|e|, so a few such rows hardly change them.
Some rows are not used: those with a motor off or at its limit, those directly after a missing
sample, and the n rows after each of these.

If n is larger than the controller's order, the law has superfluous modes, which B and R cancel. A
mode that grows from sample to sample would diverge in a simulated flight. Its eigenvalue lies
outside the unit circle. `stable_past` moves such eigenvalues onto the unit circle. Then B, R and c
are estimated again with this A.

The unexplained **share** of a law (`model.control.unexplained_share`) is σ_e/std(Δu), with
Δu[k] = u[k] − u[k−1]. σ_e is the standard deviation of e, estimated from the median of |e|. The
orders `ORDERS` are tried until a share is at most `ALIKE`. Let s be the smallest share of the tried
orders. If s exceeds `MAX_SHARE`, no controller is identified. Otherwise the result is the law of
lowest order whose share is at most s + `ALIKE`.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.control.loop_task import under_control
from heli3dof.model.control.unexplained_share import is_limited, unexplained_share
from heli3dof.model.estimation.decimated_log import decimation
from heli3dof.recording.linear_controller import LinearController
from heli3dof.recording.logs.sampling_clock import estimate_clock
from heli3dof.recording.recording import Recording

ORDERS = (1, 2, 3, 4)
"""Orders n, lowest first. An integral has order 1, a rate filter 2, a delay of one period 1."""
MAX_SHARE = 0.002
"""Largest unexplained share of an accepted controller. Chosen: in the logs of two laboratories it
was 0.001 with the controller's order, and over 0.02 with a lower order."""
ALIKE = 0.001
"""A higher order is used only if it reduces the share by more than this. Chosen."""
MAX_ROWS = 50_000
"""Largest number of rows used, the first ones: a hundred seconds at 500 Hz. Chosen."""
MAD_TO_STD = 1.4826
"""Standard deviation of a normal distribution, relative to its median absolute deviation"""
ROWS_PER_PARAMETER = 10
"""Fewest rows for each parameter of a motor's law. Chosen."""
ITERATIONS, SMALLEST_V, SETTLED_V = 50, 1e-5, 1e-7
"""Limits of `least_absolute_deviations`: the largest number of iterations; V, the |error| below
which all rows have the same weight; V, the RMS change of X θ that ends the iteration. Chosen."""
RANK_TOLERANCE = 1e-10
"""Singular values below this share of the largest one count as zero. Chosen."""


def identified_controller(recording: Recording) -> LinearController | None:
    """Return the linear controller that explains the recording's voltages; None if there is none.

    The function uses the rows in closed loop, at most the first `MAX_ROWS` of them. It returns None
    in these cases:

    * An angle of roll, pitch or yaw is missing in at least one row.
    * The log is decimated: it contains only every second, third … control period.
    * The log contains no reference of any axis. An integral of the control error would then not be
      identifiable.
    * The log has too few rows.
    * No controller of the orders `ORDERS` explains the voltages (see the head of this file).
    """
    r = under_control(recording)
    if len(r.axes) < len(AXES) or not np.isfinite(r.angle).all() or decimation(r) != 1:
        return None
    if not any(r.has_reference(a) for a in AXES):
        return None
    laws = list[LinearController]()
    for n in ORDERS:
        if law := law_of_order(r.rows(slice(0, MAX_ROWS)), n):
            laws.append(law)
            if law.share <= ALIKE:
                break
    least = min((law.share for law in laws), default=np.inf)
    if least > MAX_SHARE:
        return None
    return next(law for law in laws if law.share <= least + ALIKE)


def law_of_order(r: Recording, n: int) -> LinearController | None:
    """Return the linear controller of order ``n`` that explains the voltages of ``r`` best.

    It minimises Σ|e|, where e (V) are the logged voltages minus those of the controller. Returns
    None if ``r`` has too few rows.
    """
    u, y = r.voltage - np.nan_to_num(r.voltage_extra), r.angle - r.angle[0]
    broken = is_limited(r.voltage, r.profile.motor.v_max)
    broken[1:] |= estimate_clock(r.t).missing > 0
    k = np.flatnonzero(np.convolve(broken, np.ones(n + 1))[: len(r)] == 0)
    k = k[k >= n]
    reference = np.nan_to_num(r.reference[:, [r.has_reference(a) for a in AXES]])
    columns = [u[k - j] for j in range(1, n + 1)] + [y[k - j] for j in range(n + 1)]
    columns += [reference[k - j] for j in range(n + 1)] + [np.ones((len(k), 1))]
    X = np.hstack(columns)
    if len(k) < ROWS_PER_PARAMETER * X.shape[1]:
        return None
    theta = least_absolute_deviations(X, u[k])
    past = theta[: 2 * n]
    stable = stable_past(past)
    if stable is not past:
        rest = least_absolute_deviations(X[:, 2 * n :], u[k] - X[:, : 2 * n] @ stable)
        theta = np.vstack([stable, rest])
    t = r.t[k] - r.t[k[0]]
    share = unexplained_share(t, u[k] - X @ theta, u[k] - u[k - 1], _robust_std)
    if share is None:
        return None
    A = np.array([theta[2 * j : 2 * j + 2].T for j in range(n)])
    B = np.array([theta[2 * n + 3 * j : 2 * n + 3 * j + 3].T for j in range(n + 1)])
    return LinearController(A, B, share)


def stable_past(past: np.ndarray) -> np.ndarray:
    """Return A (2 n, 2), the weights of the past voltages, without modes outside the unit circle.

    ``past`` contains A_1ᵀ … A_nᵀ, one below the other. A mode z_i has Σ_j A_j z_i^{−j} w_i = w_i
    with the voltages w_i (2,). A mode with |z_i| > 1 becomes z_i/|z_i|, with the same w_i.

    >>> stable_past(np.diag([1.2, 0.5])).round(3).tolist()
    [[1.0, 0.0], [0.0, 0.5]]
    """
    n = len(past) // 2
    companion = np.eye(2 * n, k=-2)
    companion[:2] = past.T
    z, W = np.linalg.eig(companion)
    if (np.abs(z) <= 1).all():
        return past
    z = z / np.maximum(np.abs(z), 1)
    w = W[-2:]
    powers = np.vstack([w * z ** (n - j) for j in range(1, n + 1)])
    return np.asarray(np.linalg.solve(powers.T, (w * z**n).T).real)


def _robust_std(t: np.ndarray, e: np.ndarray) -> np.ndarray:
    """Return the standard deviation (2,) of the errors e (n, 2), from the median of |e|.

    `unexplained_share` calls this function with the times ``t``, which are not used.
    """
    return np.asarray(MAD_TO_STD * np.median(np.abs(e), axis=0))


def least_absolute_deviations(X: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return θ (m, 2) that minimises Σ|u − X θ| for each column of u (N, 2); X (N, m).

    Method: least squares, iterated with the weights 1/max(|u − X θ|, `SMALLEST_V`) of the last θ.

    >>> X = np.column_stack([np.ones(9), np.arange(9.0)])
    >>> u = X @ [[1.0, 2.0], [3.0, 4.0]]
    >>> u[4:6] += 100.0  # two wrong rows
    >>> least_absolute_deviations(X, u).round(3).tolist()
    [[1.0, 2.0], [3.0, 4.0]]
    """
    scale = np.maximum(np.abs(X).max(axis=0), 1e-12)
    U, s, Vt = np.linalg.svd(X / scale, full_matrices=False)
    full = s > RANK_TOLERANCE * s[0]
    U = U[:, full]
    c, last = U.T @ u, np.full((full.sum(), u.shape[1]), np.inf)
    for _ in range(ITERATIONS):
        if np.linalg.norm(c - last) < SETTLED_V * np.sqrt(len(u)):
            break
        last = c
        root = 1 / np.sqrt(np.maximum(np.abs(u - U @ c), SMALLEST_V))
        weighted = [(U * w[:, None], w * x) for w, x in zip(root.T, u.T, strict=True)]
        c = np.column_stack([np.linalg.solve(A.T @ A, A.T @ b) for A, b in weighted])
    theta = Vt[full].T @ (c / s[full, None])
    return np.asarray(theta / scale[:, None])
