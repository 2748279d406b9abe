"""Stabilise an identified state-space model.

`with_stable_predictor` replaces the gain K, so that the one-step predictor is stable. The state
matrix of this predictor is A − K C. `stable_plant` moves unstable poles of A and sets K to zero.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.black_box.pbsid import StateSpace


def spectral_radius(A: np.ndarray) -> float:
    """Return the spectral radius of A (n, n): the largest modulus of its eigenvalues."""
    return float(np.abs(np.linalg.eigvals(A)).max())


def kalman_gain(A: np.ndarray, C: np.ndarray, Q: np.ndarray, R: np.ndarray) -> np.ndarray | None:
    """Return the steady-state Kalman gain A P Cᵀ (C P Cᵀ + R)⁻¹, or None if there is none.

    P solves the Riccati equation for the covariances Q of process noise and R of output noise.
    """
    from scipy.linalg import LinAlgError, solve_discrete_are

    try:
        P = solve_discrete_are(A.T, C.T, Q, R)
    except (LinAlgError, ValueError):
        return None
    return np.asarray(np.linalg.solve(C @ P @ C.T + R, C @ P @ A.T).T)


def with_stable_predictor(model: StateSpace, rho: float) -> StateSpace:
    """Return the model with a spectral radius of A − K C of at most ``rho``.

    A − K C is the state matrix of the one-step predictor. If its spectral radius exceeds ``rho``,
    the function replaces K by a Kalman gain. This gain is computed for process noise with the
    covariance

        Q + c tr(Q) I,      Q = K S Kᵀ,      S: covariance of the innovations

    It tries c = 1e-6, 1e-4, …, 1e4 in this order, and takes the first c that reduces the spectral
    radius to ``rho`` or less. If there is none, the result is that of `stable_plant`.
    """
    if spectral_radius(model.At) <= rho:
        return model
    Q = model.K @ model.S @ model.K.T
    for inflate in (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4):
        noise = Q + inflate * np.trace(Q) * np.eye(model.order)
        K = kalman_gain(model.A, model.C, noise, model.S)
        if K is not None and spectral_radius(model.A - K @ model.C) <= rho:
            return replace(model, K=K)
    return stable_plant(model, rho)


def stable_plant(model: StateSpace, rho: float) -> StateSpace:
    """Return the model with K = 0 and no pole of A outside the circle of radius ``rho``.

    Poles outside the circle are moved onto it in the direction of 0.
    """
    lam, V = np.linalg.eig(model.A)
    size = np.maximum(np.abs(lam), 1e-300)
    # Slightly inside the circle, so that rounding cannot move a pole outside.
    inside = rho * (1 - 1e-4)
    A = np.real(V * (lam * np.minimum(1.0, inside / size)) @ np.linalg.inv(V))
    return replace(model, A=A, K=np.zeros_like(model.K))
