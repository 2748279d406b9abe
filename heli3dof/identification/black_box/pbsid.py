"""PBSID-opt: a state-space model in innovation form from closed-loop data, without iterations.

Let Ã = A − K C be stable. Up to a term in Ã^p, the prediction ŷ of the output y depends only on the
last p samples of input u and output y. d is a constant offset:

    ŷ[k] = Σ_{j=1..p} Ξ_j z[k−j] + d,     z = (u, y),     Ξ_j = C Ã^{j−1} [B K]

1. Find Ξ by least squares (VARX: vector autoregression with inputs; by QR). The innovations are
   white, so feedback causes no bias.
2. The extended observability matrix times the controllability matrix, Γ 𝒦, is block upper
   triangular Toeplitz in Ξ. Its block rows are weighted by S^{−1/2}, S the innovations' covariance.
   With Z_p the last p samples of every row, x̂ is, up to scale, the first n right singular vectors
   of Γ 𝒦 Z_p.
3. Find C, then the innovations e, then A, B, K by regressions on x̂.

Source: Chiuso, "The role of vector autoregressive modeling in predictor-based subspace
identification", Automatica 43 (2007) 1034–1048; van der Veen et al., IET Control Theory &
Applications 7 (2013) 1339–1358.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class StateSpace:
    """A discrete-time linear model in innovation form, with n states, m inputs and l outputs.

        x[k+1] = A x[k] + B u[k] + K (y[k] − C x[k]),   y[k] = C x[k] + d + e[k]

    - u (m,), y (l,): inputs and outputs, as deviations from a trim
    - x (n,): state
    - d (l,): constant offset of the outputs
    - e (l,): innovation, with the covariance S (l, l)

    The gain K multiplies y − C x, which is the sum of e and d.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    K: np.ndarray
    d: np.ndarray
    S: np.ndarray

    @property
    def order(self) -> int:
        return int(self.A.shape[0])

    @property
    def At(self) -> np.ndarray:
        """Return Ã = A − K C (n, n), the one-step predictor's state matrix."""
        return np.asarray(self.A - self.K @ self.C)


@dataclass(frozen=True, eq=False)
class Varx:
    """A fitted VARX: a vector autoregression of order p with m inputs u and l outputs y.

    y[k] = Σ_{j=1..p} Ξ_j z[k−j] + d + e[k], with z = (u, y) and the innovation e. Ξ has the shape
    (p, l, m+l), d (l,), and the covariance S of e (l, l).
    """

    Xi: np.ndarray
    d: np.ndarray
    innovations: tuple[np.ndarray, ...]
    """Innovations e: an array (N_i − p, l) for each segment of N_i rows"""
    S: np.ndarray


Pair = tuple[np.ndarray, np.ndarray]
"""Inputs u (N, m) and outputs y (N, l) of one segment of data without gaps"""


def past(u: np.ndarray, y: np.ndarray, p: int) -> np.ndarray:
    """Return the regressors (N − p, p(m+l)) of a VARX (autoregression with inputs) of order p.

    Row k − p holds z[k−1], …, z[k−p], with z = (u, y), inputs u (N, m) and outputs y (N, l).
    """
    z = np.hstack([u, y])
    n = len(z) - p
    return np.hstack([z[p - j : p - j + n] for j in range(1, p + 1)])


def varx(data: Sequence[Pair], p: int) -> Varx:
    """Return a VARX (vector autoregression with inputs) of order p, fitted to segments ``data``.

    Each segment has inputs and outputs. Raises ValueError if there are too few rows.
    """
    usable = [(u, y) for u, y in data if len(u) > p]
    m, l = data[0][0].shape[1], data[0][1].shape[1]
    Z = np.vstack([past(u, y, p) for u, y in usable])
    Y = np.vstack([y[p:] for _, y in usable])
    q = Z.shape[1]
    if len(Z) < 2 * (q + 1):
        raise ValueError(f"{len(Z)} rows cannot carry a VARX of order {p} ({q + 1} columns)")
    scale = np.maximum(Z.std(axis=0), 1e-12)
    R = _triangle(np.hstack([Z / scale, np.ones((len(Z), 1)), Y]))
    theta, *_ = np.linalg.lstsq(R[: q + 1, : q + 1], R[: q + 1, q + 1 :], rcond=1e-12)
    theta[:q] /= scale[:, None]
    Xi = theta[:q].T.reshape(l, p, m + l).transpose(1, 0, 2)
    E = tuple(y[p:] - past(u, y, p) @ theta[:q] - theta[q] for u, y in usable)
    e = np.vstack(E)
    return Varx(Xi, theta[q], E, e.T @ e / len(e))


def states(data: Sequence[Pair], fit: Varx, n_max: int) -> list[np.ndarray]:
    """Return the state estimates x̂ (N_i − p, n_max) of each segment.

    ``fit`` is a VARX of order p, fitted to the segments ``data`` of N_i rows.
    """
    p, l, w = fit.Xi.shape
    L = np.linalg.cholesky(np.linalg.inv(fit.S))
    GK = np.zeros((p * l, p * w))
    for i in range(p):
        for j in range(i, p):
            GK[i * l : (i + 1) * l, (j - i) * w : (j - i + 1) * w] = L.T @ fit.Xi[j]
    pasts = [past(u, y, p) for u, y in data if len(u) > p]
    mean = np.vstack(pasts).mean(axis=0)
    R = _triangle(np.vstack([z - mean for z in pasts]))
    U, s, _ = np.linalg.svd(GK @ R.T, full_matrices=False)
    T = U[:, :n_max].T @ GK / np.sqrt(s[:n_max, None])
    return [(z - mean) @ T.T for z in pasts]


def realise(data: Sequence[Pair], x: Sequence[np.ndarray], p: int, n: int) -> StateSpace:
    """Return the state-space model of order n by regression on the state sequences ``x``.

    `states` returns ``x`` for the segments ``data`` and a VARX (autoregression) of order p.
    """
    usable = [(u[p:], y[p:]) for u, y in data if len(u) > p]
    m = usable[0][0].shape[1]
    X = np.vstack([xi[:, :n] for xi in x])
    Y = np.vstack([y for _, y in usable])
    one = np.ones((len(X), 1))
    Cd, *_ = np.linalg.lstsq(np.hstack([X, one]), Y, rcond=None)
    E = Y - np.hstack([X, one]) @ Cd
    starts = np.cumsum([0, *(len(xi) for xi in x)])
    rows, nexts = [], []
    for (u, _), xi, a, b in zip(usable, x, starts[:-1], starts[1:], strict=True):
        rows.append(np.hstack([xi[:-1, :n], u[:-1], E[a : b - 1], np.ones((len(xi) - 1, 1))]))
        nexts.append(xi[1:, :n])
    W, *_ = np.linalg.lstsq(np.vstack(rows), np.vstack(nexts), rcond=None)
    A, B, K = W[:n].T, W[n : n + m].T, W[n + m : -1].T
    return StateSpace(A, B, Cd[:n].T, K, Cd[n], E.T @ E / len(E))


def _triangle(a: np.ndarray) -> np.ndarray:
    """Return the triangular factor R of the QR factorisation of the matrix ``a``."""
    return np.asarray(np.linalg.qr(a, mode="r"))
