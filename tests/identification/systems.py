"""Linear systems with known answers, for the estimators' tests."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.identification.black_box.pbsid import Pair, StateSpace, realise, states, varx


def integrating_system(sigma: float = 1e-3) -> StateSpace:
    """Three outputs, two inputs, five states every 0.05 s; the third output integrates the second.

    Poles 0.9 ± 0.2j, 0.8, 0.6 and 1; two of them cannot be recorded without feedback,
    like the rig's.
    """
    A = np.zeros((5, 5))
    A[:2, :2] = [[0.9, 0.2], [-0.2, 0.9]]
    A[2, 2], A[3, 3] = 0.8, 0.6
    A[4, 2], A[4, 4] = 0.1, 1.0
    B = np.array([[0.1, 0.1], [0.05, 0.04], [0.2, -0.2], [0.4, -0.3], [0.0, 0.0]])
    C = np.array([[1.0, 0, 0, 1.0, 0], [0, 0, 1.0, 0, 0], [0, 0, 0, 0, 1.0]])
    K = np.array([[0.5, 0, 0], [0.1, 0, 0], [0, 0.4, 0.1], [0.1, 0.1, 0], [0, 0.05, 0.5]])
    return StateSpace(A, B, C, K, np.zeros(3), sigma**2 * np.diag([1.0, 0.7, 0.5]))


FEEDBACK = np.array([[0.8, 0.6, 0.7], [0.8, -0.6, -0.7]])


def record(
    system: StateSpace,
    n: int,
    seed: int,
    *,
    gain: np.ndarray | None = FEEDBACK,
    excitation: float = 0.05,
) -> Pair:
    """u (n, 2), y (n, 3): u = r − gain·y (or r alone), r white, e white with the system's S."""
    rng = np.random.default_rng(seed)
    e = rng.standard_normal((n, 3)) @ np.linalg.cholesky(system.S).T if system.S.any() else None
    r = excitation * rng.standard_normal((n, 2))
    u, y = np.empty((n, 2)), np.empty((n, 3))
    x = np.zeros(system.order)
    for k in range(n):
        noise = np.zeros(3) if e is None else e[k]
        y[k] = system.C @ x + noise
        u[k] = r[k] - (0 if gain is None else gain @ y[k])
        x = system.A @ x + system.B @ u[k] + system.K @ noise
    return u, y


def sorted_poles(A: np.ndarray) -> np.ndarray:
    """Eigenvalues by real, then imaginary part."""
    return np.sort_complex(np.linalg.eigvals(A))


def pbsid(data: Sequence[Pair], n: int, p: int) -> StateSpace:
    """Return a model with n states, by PBSID-opt from segments ``data``; p is the VARX's order."""
    fit = varx(data, p)
    x = states(data, fit, n)
    return realise(data, x, p, n)
