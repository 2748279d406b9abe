"""Prediction-error identification in innovation form, with exact sensitivities.

The model predicts the outputs y from the inputs u and earlier outputs. x is the state, e the
innovation, and d a constant offset of the outputs:

    x[k+1] = Ã x[k] + B u[k] + K y[k],      y[k] = C x[k] + d + e[k],      Ã = A − K C

The criterion V is the negative Gaussian log-likelihood of N innovations e, divided by N, without
constant terms. At the S (covariance of e) that minimises it:

    V(θ) = ½ log det S(θ),      S = (1/N) Σ e[k] e[k]ᵀ

Levenberg–Marquardt steps of the parameters θ minimise V. The parameters are d and the entries of Ã,
B, K and C. With n states, m inputs and l outputs, these matrices have n(n+m+2l) entries. n²
directions in the space of the entries only change the state coordinates (x → T x, Ã → T Ã T⁻¹ …),
not the prediction. At each iterate, a QR factorisation of these directions gives an orthonormal
basis of the n(m+2l) other directions, and θ moves only along these. This is the method of
"data-driven local coordinates" (McKelvey, Helmersson & Ribarits, Automatica 40 (2004) 1629–1635).

The initial state of each segment enters linearly and is eliminated (variable projection). The
predictor is stable if ρ(Ã) < 1 (spectral radius), while A, the state matrix of the plant, may have
integrators or unstable poles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.identification.black_box.one_step_predictor import (
    filter_states,
    free_responses,
    output_sensitivities,
)
from heli3dof.identification.black_box.pbsid import Pair, StateSpace
from heli3dof.identification.black_box.stabilisation import stable_plant, with_stable_predictor

CHUNK = 4096
TOLERANCE = 1e-5
"""The search ends when a step lowers the criterion V by less than this."""
BLOCK = 50
"""Rows over which the likelihood's gradient is summed for the covariance"""
RHO_MAX = 1 - 1e-7


@dataclass(frozen=True, eq=False)
class PemFit:
    """The result of a prediction-error fit (`pem`): the model and its p parameters' covariance."""

    model: StateSpace
    tangent: np.ndarray
    """(n(n+m+2l), p): column q is the derivative of the entries of [Ã B K] and C by parameter q"""
    covariance: np.ndarray
    """(p, p): covariance of the parameters, in sandwich form (valid for coloured innovations)"""
    cost: float
    """The criterion V = ½ log det S at the minimum, S the innovations' covariance"""
    iterations: int
    converged: bool


@dataclass(eq=False)
class _Point:
    W: np.ndarray  # [Ã B K], (n, n+m+l)
    C: np.ndarray
    d: np.ndarray
    x: list[np.ndarray]
    e: list[np.ndarray]
    S: np.ndarray
    cost: float


def pem(
    data: Sequence[Pair],
    start: StateSpace,
    *,
    max_iterations: int = 40,
    output_error: bool = False,
    rho_max: float = RHO_MAX,
) -> PemFit:
    """Return the fit of a state-space model that minimises V = ½ log det S of the innovations.

    Args:
        data: segments at one rate, u (N, m) and y (N, l), deviations from fixed trims.
        start: initial model, for instance from `heli3dof.identification.black_box.pbsid.realise`.
            The function first makes its predictor stable.
        max_iterations: largest number of Levenberg–Marquardt steps.
        rho_max: largest spectral radius of Ã = A − K C; steps beyond it are rejected.
        output_error: fix K = 0, so the innovation is the simulation error. Feedback then biases the
            fit.
    """
    u_s = np.vstack([u for u, _ in data]).std(axis=0) + 1e-12
    y_s = np.vstack([y for _, y in data]).std(axis=0) + 1e-12
    scaled = [(np.ascontiguousarray(u / u_s), np.ascontiguousarray(y / y_s)) for u, y in data]
    n = start.order
    l = len(y_s)
    start = stable_plant(start, rho_max) if output_error else with_stable_predictor(start, rho_max)
    W = np.hstack([start.At, start.B * u_s, start.K * y_s])
    C = start.C / y_s[:, None]
    W, C = _balanced(W, C, n)
    point = _evaluate(scaled, W, C, start.d / y_s, np.diag(np.diag(start.S) / y_s**2), rho_max)
    lam, converged, iterations = 1e-3, False, 0
    while iterations < max_iterations:
        iterations += 1
        T = _tangent(point.W, point.C, output_error, len(u_s))
        H, g = _gram(scaled, point, T)
        scale = 1 / np.sqrt(np.maximum(np.diag(H), 1e-12 * np.diag(H).max()))
        Hs = H * scale[:, None] * scale
        new = point
        while lam < 1e8:
            step = scale * np.linalg.solve(Hs + lam * np.eye(len(g)), scale * g)
            W2, C2, d2 = _move(point, T, step, l)
            new = _evaluate(scaled, W2, C2, d2, point.S, rho_max)
            if new.cost < point.cost:
                break
            lam *= 4
        if not new.cost < point.cost:
            converged = True
            break
        gain = point.cost - new.cost
        point = new
        lam = max(lam / 5, 1e-9)
        if gain < TOLERANCE:
            converged = True
            break
    T = _tangent(point.W, point.C, output_error, len(u_s))
    H, _, M = _gram(scaled, point, T, scores=True)
    Hi = np.linalg.pinv(H, rcond=1e-12, hermitian=True)
    cov = Hi @ M @ Hi
    # Back to V and rad: the tangent's rows scale like the entries they change.
    m = len(u_s)
    unit_W = np.hstack([np.ones((n, n)), np.ones((n, 1)) / u_s, np.ones((n, 1)) / y_s])
    unit = np.concatenate([unit_W.ravel(), np.repeat(y_s, n)])
    Wp, Cp = point.W * unit_W, point.C * y_s[:, None]
    K = Wp[:, n + m :]
    model = StateSpace(
        Wp[:, :n] + K @ Cp, Wp[:, n : n + m], Cp, K, point.d * y_s, point.S * np.outer(y_s, y_s)
    )
    return PemFit(
        model,
        T * unit[:, None],
        cov[: T.shape[1], : T.shape[1]],
        point.cost + float(np.log(y_s).sum()),
        iterations,
        converged,
    )


def _balanced(W: np.ndarray, C: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return W = [Ã B K] and C in balanced coordinates; Ã = A − K C, n states."""
    from scipy.linalg import cholesky, solve_discrete_lyapunov, svd

    At = W[:, :n]
    rho = np.abs(np.linalg.eigvals(At)).max()
    shrunk = At * min(1.0, 0.999 / rho) if rho > 0 else At
    P = solve_discrete_lyapunov(shrunk, W[:, n:] @ W[:, n:].T)
    Q = solve_discrete_lyapunov(shrunk.T, C.T @ C)
    eye = np.eye(n)
    P = (P + P.T) / 2 + 1e-10 * np.trace(P) * eye
    Q = (Q + Q.T) / 2 + 1e-10 * np.trace(Q) * eye
    R = cholesky(P, lower=True)
    L = cholesky(Q, lower=True)
    U, s, Vt = svd(L.T @ R)
    T = R @ Vt.T / np.sqrt(s)
    Ti = (U / np.sqrt(s)).T @ L.T
    return np.hstack([Ti @ At @ T, Ti @ W[:, n:]]), C @ T


def _evaluate(data, W, C, d, S, rho_max) -> _Point:  # type: ignore[no-untyped-def]
    """Return states, innovations and cost of the model with W = [Ã B K], C and the output offset d.

    The cost is ∞ if the spectral radius of Ã = A − K C exceeds ``rho_max``. ``data``: segments
    (u, y). S (l, l), an earlier covariance of the innovations, weights the fit of the initial
    states.
    """
    n = W.shape[0]
    m = data[0][0].shape[1]
    At, B, K = (np.ascontiguousarray(a) for a in np.split(W, [n, n + m], axis=1))
    C = np.ascontiguousarray(C)
    bad = _Point(W, C, d, [], [], S, np.inf)
    if not np.all(np.isfinite(W)) or np.abs(np.linalg.eigvals(At)).max() > rho_max:
        return bad
    xs, es = [], []
    Wh = np.linalg.cholesky(np.linalg.inv(S)).T
    for u, y in data:
        x = filter_states(At, B, K, u, y, np.zeros(n))
        e = y - x @ C.T - d
        O = free_responses(At, C, len(u))
        x0, *_ = np.linalg.lstsq(
            np.einsum("ij,kjq->kiq", Wh, O).reshape(-1, n), (e @ Wh.T).ravel(), rcond=1e-10
        )
        es.append(e - O @ x0)
        xs.append(filter_states(At, B, K, u, y, x0))
    e = np.vstack(es)
    S = e.T @ e / len(e)
    sign, logdet = np.linalg.slogdet(S)
    if sign <= 0 or not np.isfinite(logdet):
        return bad
    return _Point(W, C, d, xs, es, S, 0.5 * float(logdet))


def _tangent(W: np.ndarray, C: np.ndarray, output_error: bool, m: int) -> np.ndarray:
    """Return an orthonormal basis (entries, p) of the changes of W, C that alter the predictor.

    W (n, n+m+l) is [Ã B K], C (l, n) the output matrix, m the number of inputs. ``entries`` is the
    number of entries of W and C together. With ``output_error`` K stays fixed.
    """
    n, l, w = W.shape[0], C.shape[0], W.shape[1]
    entries = n * w + l * n
    eye = np.eye(n)
    # Changes of the state coordinates: X ↦ (X Ã − Ã X, X B, X K, −C X), a column per entry of X.
    dW = np.kron(eye, W.T).reshape(n, w, n * n)
    dW[:, :n] -= np.kron(W[:, :n], eye).reshape(n, n, n * n)
    gauge = np.vstack([dW.reshape(n * w, n * n), -np.kron(C, eye)])
    mask = np.ones(entries, dtype=bool)
    if output_error:
        mask[: n * w] = np.tile(np.arange(w) < n + m, n)
    Q, _ = np.linalg.qr(gauge[mask], mode="complete")
    T = np.zeros((entries, int(mask.sum()) - n * n))
    T[mask] = Q[:, n * n :]
    return T


def _move(point: _Point, T: np.ndarray, step: np.ndarray, l: int):  # type: ignore[no-untyped-def]
    delta = T @ step[:-l]
    w = point.W.size
    W = point.W + delta[:w].reshape(point.W.shape)
    C = point.C + delta[w:].reshape(point.C.shape)
    return W, C, point.d + step[-l:]


def _gram(data, point: _Point, T: np.ndarray, scores: bool = False):  # type: ignore[no-untyped-def]
    """Return information (q, q) and gradient (q,) of the log-likelihood at the model ``point``.

    The q = p + l parameters are steps along the p columns of T (from `_tangent`), and the offset d.
    Initial states are eliminated. With ``scores``, there is a third result (q, q): the sum of
    `_score_blocks` over the segments.
    """
    n, l = point.W.shape[0], point.C.shape[0]
    p = T.shape[1]
    w = point.W.size
    dW = np.ascontiguousarray(T[:w].reshape(*point.W.shape, p))
    dC = np.ascontiguousarray(T[w:].reshape(l, n, p))
    At = np.ascontiguousarray(point.W[:, :n])
    Wh = np.linalg.cholesky(np.linalg.inv(point.S)).T
    H, g = np.zeros((p + l, p + l)), np.zeros(p + l)
    M = np.zeros((p + l, p + l))
    for (u, y), x, e in zip(data, point.x, point.e, strict=True):
        N = len(u)
        O = free_responses(At, point.C, N)
        xi = np.zeros((n, p))
        G = np.zeros((n + p + l + 1,) * 2)
        kept = []
        for a in range(0, N, CHUNK):
            b = min(a + CHUNK, N)
            J = np.empty((b - a, l, p))
            output_sensitivities(At, point.C, dW, dC, xi, x[a:b], u[a:b], y[a:b], J)
            F = np.empty((b - a, l, n + p + l + 1))
            F[:, :, :n] = O[a:b]
            F[:, :, n : n + p] = J
            F[:, :, n + p : n + p + l] = np.eye(l)
            F[:, :, -1] = e[a:b]
            F = np.einsum("ij,kjq->kiq", Wh, F)
            flat = F.reshape(-1, F.shape[2])
            G += flat.T @ flat
            if scores:
                kept.append(F)
        back = np.linalg.pinv(G[:n, :n], rcond=1e-12, hermitian=True) @ G[:n, n:]
        Sch = G[n:, n:] - G[:n, n:].T @ back
        H += Sch[:-1, :-1]
        g += Sch[:-1, -1]
        if scores:
            M += _score_blocks(np.vstack(kept), back, n)
    return (H, g, M) if scores else (H, g)


def _score_blocks(F: np.ndarray, back: np.ndarray, n: int) -> np.ndarray:
    """Return Σ s sᵀ (q, q), a sum over blocks of `BLOCK` rows.

    s (q,) is the gradient of the log-likelihood, summed over a block. Blocks allow for coloured
    innovations. F (N, l, n + q + 1) contains, for N rows of l outputs, the prediction's derivatives
    by n initial states and q parameters, then the innovation. ``back`` (n, q + 1): coefficients by
    which least squares eliminates the initial states.
    """
    F = F[:, :, n:] - F[:, :, :n] @ back
    s = np.einsum("kiq,ki->kq", F[:, :, :-1], F[:, :, -1])
    s = np.add.reduceat(s, np.arange(0, len(s), BLOCK), axis=0)
    return np.asarray(s.T @ s)
