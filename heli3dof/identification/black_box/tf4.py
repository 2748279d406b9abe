"""Fit the paper's form, eq (17): six transfer functions over one fourth-order denominator.

    y_i(s) = Σ_j N_ij(s)/D(s) u_j(s) + I_i(s)/D(s) + c_i/s
    D(s) = (s² + a₁ s + a₀)(s² + b₁ s + b₀),  a, b > 0,      deg N, deg I ≤ 3

y_i is angle i (rad), u_j the voltage of motor j (V), c_i a constant offset. N and I are polynomials
in s; I_i stands for the initial condition. The fit is the default of the paper's toolbox: *output
error* with a stable denominator. For a given D all other coefficients enter linearly. So the search
is over log(a₁, a₀, b₁, b₀) only (variable projection, Golub & Pereyra 1973). The input u is held
over each interval. Each segment has its own initial condition I; the offsets c are common.

The method exists to reproduce the paper. Output error assumes voltages that are independent of the
disturbances, which does not hold in closed loop. And four stable poles cannot describe this plant,
which has at least six states and an integrator in yaw (erratum E14).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.identification.black_box.pbsid import Pair
from heli3dof.identification.transfer_function import TransferFunctions
from heli3dof.model.discretisation import c2d_zoh

STARTS = ((0.3, 0.2, 0.3, 1.2), (0.7, 0.3, 0.7, 1.25), (1.0, 0.05, 2.0, 4.0), (2.0, 1.0, 5.0, 20.0))
"""Starts of the search, (a₁, a₀, b₁, b₀); the second is close to the denominator of (17)."""
BLOCK_S = 2.0
"""s: length of the blocks over which the cost's gradient is summed for the covariance. Blocks are
needed because simulation errors are strongly coloured."""


def denominator(log_parameters: np.ndarray) -> np.ndarray:
    """Return the coefficients (5,) of D(s) = (s² + a₁ s + a₀)(s² + b₁ s + b₀), s⁴ first.

    ``log_parameters`` (4,) are the logarithms of a₁, a₀, b₁, b₀.
    """
    a1, a0, b1, b0 = np.exp(log_parameters)
    return np.convolve([1.0, a1, a0], [1.0, b1, b0])


def companion(den: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the companion form A (4, 4), B (4, 1) of 1/D(s); ``den`` (5,) are D's coefficients.

    The states of ẋ = A x + B u are x(s) = [1 s s² s³]ᵀ u(s)/D(s).
    """
    n = len(den) - 1
    A = np.eye(n, k=1)
    A[-1] = -den[:0:-1]
    B = np.zeros((n, 1))
    B[-1, 0] = 1.0
    return A, B


def _regressors(data: Sequence[Pair], den: np.ndarray, T: float) -> np.ndarray:
    """Return the regressors of the angles for the denominator ``den`` (5,), a row per sample.

    There are 8 + 4 S + 1 columns for S segments ``data``: both voltages filtered by s^i/D(s),
    i = 0 … 3; per segment, four responses to its initial state; ones. T (s) is the sampling
    interval.
    """
    from scipy.signal import lfilter

    A, B = c2d_zoh(*companion(den), T)
    denom = np.real(np.poly(A))
    m = data[0][0].shape[1]
    # Numerators of the sampled states: x(z) = adj(zI − A) B / det, by its impulse response.
    n = len(A)
    impulse = np.zeros((n + 1, n))
    x = B[:, 0]
    for k in range(1, n + 1):
        impulse[k] = x
        x = A @ x
    nums = np.array([np.convolve(denom, impulse[:, i])[: n + 1] for i in range(n)])
    total = sum(len(u) for u, _ in data)
    out = np.zeros((total, m * n + n * len(data) + 1))
    out[:, -1] = 1.0
    row = 0
    for s, (u, _) in enumerate(data):
        N = len(u)
        for j in range(m):
            for i in range(n):
                out[row : row + N, j * n + i] = lfilter(nums[i], denom, u[:, j])
        free = np.zeros(N)
        free[0] = 1.0
        for i in range(n):
            # The four shifts of 1/det span all free responses.
            shifted = np.concatenate([np.zeros(i), free[: N - i]])
            out[row : row + N, m * n + s * n + i] = lfilter([1.0], denom, shifted)
        row += N
    return out


def fit_tf4(data: Sequence[Pair], T: float) -> tuple[TransferFunctions, np.ndarray, np.ndarray]:
    """Return fourth-order transfer functions, fitted to segments of voltages and angles.

    The other results are the offset c (3,) rad of the angles, and the covariance (3, 3) rad² of the
    simulation errors. ``data`` has u (N, 2) V and y (N, 3) rad per segment; T (s) is their sampling
    interval.
    """
    from scipy.optimize import least_squares

    Y = np.vstack([y for _, y in data])
    size = Y.std(axis=0) + 1e-12

    def solve(log_p: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        X = _regressors(data, denominator(log_p), T)
        scale = np.linalg.norm(X, axis=0) + 1e-300
        theta = np.linalg.lstsq(X / scale, Y, rcond=1e-10)[0] / scale[:, None]
        return X, theta, Y - X @ theta

    def residual(log_p: np.ndarray) -> np.ndarray:
        return np.asarray((solve(log_p)[2] / size).ravel())

    best = None
    for start in STARTS:
        found = least_squares(
            residual, np.log(start), bounds=(np.log(1e-4), np.log(1e4)), max_nfev=60
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    X, theta, E = solve(best.x)
    m, n = data[0][0].shape[1], 4
    num = np.zeros((3, m, n + 1))
    for j in range(m):
        num[:, j, 1:] = theta[j * n : (j + 1) * n].T[:, ::-1]
    den = denominator(best.x)
    covariance = _covariance(data, T, best.x, X, theta, E, size)
    return TransferFunctions(num, den, covariance), theta[-1], E.T @ E / len(E)


def _covariance(
    data: Sequence[Pair],
    T: float,
    log_p: np.ndarray,
    X: np.ndarray,
    theta: np.ndarray,
    E: np.ndarray,
    size: np.ndarray,
) -> np.ndarray:
    """Return the sandwich covariance of the coefficients [den[1:], num.ravel()].

    ``log_p`` (4,) are the logarithms of the denominator's parameters. X are the `_regressors` for
    this denominator, a row per sample; ``theta`` are their coefficients for the three angles. E are
    the simulation errors (rad), ``size`` (3,) the angles' standard deviations (rad). T (s) is the
    sampling interval of ``data``.
    """
    q, outputs = X.shape[1], E.shape[1]
    p = 4 + q * outputs
    J = np.zeros((len(E), outputs, p))
    for k in range(4):
        h = 1e-5
        up, down = (
            _regressors(data, denominator(log_p + sign * h * np.eye(4)[k]), T) @ theta
            for sign in (1, -1)
        )
        J[:, :, k] = (up - down) / (2 * h)
    for i in range(outputs):
        J[:, i, 4 + i * q : 4 + (i + 1) * q] = X
    J /= size[None, :, None]
    flat = J.reshape(-1, p)
    scale = 1 / (np.linalg.norm(flat, axis=0) + 1e-300)
    H = np.linalg.pinv((flat * scale).T @ (flat * scale), rcond=1e-12, hermitian=True)
    scores = np.einsum("kip,ki->kp", J, E / size) * scale
    block = max(1, round(BLOCK_S / T))
    sums = np.add.reduceat(scores, np.arange(0, len(scores), block), axis=0)
    cov = H @ (sums.T @ sums) @ H * np.outer(scale, scale)
    # Convert to coefficients: den from logarithms, num in the order of `TransferFunctions`.
    a1, a0, b1, b0 = np.exp(log_p)
    a, b = np.array([1.0, a1, a0]), np.array([1.0, b1, b0])
    D = np.column_stack(
        [
            np.convolve([0, a1, 0], b)[1:], np.convolve([0, 0, a0], b)[1:],
            np.convolve(a, [0, b1, 0])[1:], np.convolve(a, [0, 0, b0])[1:],
        ]
    )  # fmt: skip
    m, n = 2, 4
    M = np.zeros((n + outputs * m * (n + 1), p))
    M[:n, :4] = D
    for i in range(outputs):
        for j in range(m):
            row, column = n + (i * m + j) * (n + 1), 4 + i * q + j * n
            M[row + 1 : row + n + 1, column : column + n] = np.eye(n)[::-1]
    return np.asarray(M @ cov @ M.T)


def state_space(
    transfer: TransferFunctions, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the discrete state-space model A (8, 8), B (8, 2), C (3, 8) at the interval dt (s)."""
    A, B = companion(transfer.den)
    m = transfer.num.shape[1]
    Ad, Bd = c2d_zoh(np.kron(np.eye(m), A), np.kron(np.eye(m), B), dt)
    C = np.hstack([transfer.num[:, j, :0:-1] for j in range(m)])
    return Ad, Bd, C
