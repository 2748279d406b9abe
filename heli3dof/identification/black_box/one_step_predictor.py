"""Compute the one-step predictions of a model in innovation form, and their sensitivities.

    x̂[k+1] = Ã x̂[k] + B u[k] + K y[k],      Ã = A − K C
      ŷ[k] = C x̂[k] + d,                      e[k] = y[k] − ŷ[k]

u (m columns) and y (l columns) are deviations from fixed trims; d (l,) is the remaining offset.
x̂ (n,) is the state, e the innovation, A the state matrix, and k numbers the rows. (Ã, B, K, C)
depend on parameters θ_q; ∂ is the derivative by θ_q. The sensitivity ξ_q = ∂x̂/∂θ_q obeys the same
recursion,

    ξ_q[k+1] = Ã ξ_q[k] + ∂Ã x̂[k] + ∂B u[k] + ∂K y[k],      ∂ŷ/∂θ_q = C ξ_q + ∂C x̂[k]
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def filter_states(
    At: np.ndarray, B: np.ndarray, K: np.ndarray, u: np.ndarray, y: np.ndarray, x0: np.ndarray
) -> np.ndarray:
    """Return the one-step predictor's states x̂ (N, n), which start at x0 (n,).

    ``At`` (n, n) is Ã = A − K C, ``B`` (n, m) the input matrix, ``K`` (n, l) the predictor's gain.
    ``u`` (N, m) are the inputs, ``y`` (N, l) the measured outputs.
    """
    N, n = u.shape[0], At.shape[0]
    m, l = u.shape[1], y.shape[1]
    x = np.empty((N, n))
    now = x0.copy()
    new = np.empty(n)
    for k in range(N):
        for i in range(n):
            x[k, i] = now[i]
            s = 0.0
            for j in range(n):
                s += At[i, j] * now[j]
            for j in range(m):
                s += B[i, j] * u[k, j]
            for j in range(l):
                s += K[i, j] * y[k, j]
            new[i] = s
        now, new = new, now
    return x


@njit(cache=True)
def free_responses(At: np.ndarray, C: np.ndarray, N: int) -> np.ndarray:
    """Return C Ã^k (N, l, n) for k = 0 … N − 1: the output's sensitivity to the initial state.

    ``At`` (n, n) is Ã = A − K C, ``C`` (l, n) the output matrix. After all entries have fallen
    below 1e-14, the following ones are set to 0.
    """
    n, l = At.shape[0], C.shape[0]
    out = np.zeros((N, l, n))
    row = C.copy()
    new = np.empty((l, n))
    for k in range(N):
        largest = 0.0
        for i in range(l):
            for j in range(n):
                out[k, i, j] = row[i, j]
                s = 0.0
                for q in range(n):
                    s += row[i, q] * At[q, j]
                new[i, j] = s
                largest = max(largest, abs(s))
        row, new = new, row
        if largest < 1e-14:
            break
    return out


@njit(cache=True, fastmath=True)
def output_sensitivities(
    At: np.ndarray,
    C: np.ndarray,
    dW: np.ndarray,
    dC: np.ndarray,
    xi: np.ndarray,
    x: np.ndarray,
    u: np.ndarray,
    y: np.ndarray,
    out: np.ndarray,
) -> None:
    """Fill ``out`` (N, l, p) with the output's sensitivity ∂ŷ/∂θ to p parameters θ.

    ``At`` (n, n) is Ã = A − K C, ``C`` (l, n) the output matrix. ``u`` (N, m) are the inputs, ``y``
    (N, l) the outputs, ``x`` (N, n) the states that `filter_states` returns. ``dW`` (n, n+m+l, p)
    is ∂[Ã B K]/∂θ, ``dC`` (l, n, p) is ∂C/∂θ. ``xi`` (n, p) is ∂x̂/∂θ at the first row; the function
    overwrites it with the value after the last row.
    """
    N, n = x.shape
    m, l, p = u.shape[1], y.shape[1], xi.shape[1]
    new = np.empty((n, p))
    z = np.empty(n + m + l)
    for k in range(N):
        for i in range(n):
            z[i] = x[k, i]
        for i in range(m):
            z[n + i] = u[k, i]
        for i in range(l):
            z[n + m + i] = y[k, i]
        for i in range(l):
            for q in range(p):
                out[k, i, q] = 0.0
            for j in range(n):
                c = C[i, j]
                xj = z[j]
                for q in range(p):
                    out[k, i, q] += c * xi[j, q] + xj * dC[i, j, q]
        for i in range(n):
            for q in range(p):
                new[i, q] = 0.0
            for j in range(n):
                a = At[i, j]
                for q in range(p):
                    new[i, q] += a * xi[j, q]
            for j in range(n + m + l):
                zj = z[j]
                for q in range(p):
                    new[i, q] += zj * dW[i, j, q]
        for i in range(n):
            for q in range(p):
                xi[i, q] = new[i, q]
