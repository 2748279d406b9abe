"""Compute standard deviations of poles, transfer functions and frequency responses (delta method).

A fit has p parameters θ with covariance P (p, p). The one-step predictor has the matrices Ã, B, K,
C, with Ã = A − K C and the Kalman gain K. Θ = ``PemFit.tangent`` holds the derivatives of their
entries with respect to θ. A smooth function f (q,) of the model, for instance its poles, has to
first order the covariance

    cov f = F P Fᵀ,      F = ∂f/∂θ = ∂f/∂(Ã, B, K, C) · Θ      (q, p)

For a simple pole λ of A = Ã + K C with left and right eigenvectors w, v (wᴴv = 1),
∂λ = wᴴ (∂Ã + ∂K C + K ∂C) v. With the sampling interval T (s), the continuous-time pole
s = log(λ)/T has ∂s = ∂λ/(λ T). Other functions are differentiated numerically. P accounts for
noise, but neither for a wrong model order nor for unmodelled nonlinearity.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from heli3dof.identification.black_box.pbsid import StateSpace
from heli3dof.identification.black_box.pem import PemFit
from heli3dof.identification.black_box.resampling import continuous
from heli3dof.identification.fit_result import Pole
from heli3dof.model.discretisation import Continuous


def moved(model: StateSpace, delta: np.ndarray) -> StateSpace:
    """Return ``model`` with its matrices changed by the vector ``delta``.

    ``delta`` lists the changes of [Ã B K], then of C, both row by row. Ã = A − K C is the state
    matrix of the one-step predictor. The new A of the model is the new Ã + K C.
    """
    n, m, l = model.order, model.B.shape[1], len(model.C)
    dW = delta[: n * (n + m + l)].reshape(n, n + m + l)
    C = model.C + delta[n * (n + m + l) :].reshape(l, n)
    K = model.K + dW[:, n + m :]
    return replace(model, A=model.At + dW[:, :n] + K @ C, B=model.B + dW[:, n : n + m], C=C, K=K)


def continuous_pole(lam: complex, T: float) -> complex:
    """Return the continuous-time pole log(λ)/T (rad/s), or log|λ|/T if λ is real.

    λ = ``lam`` is the discrete-time pole, T (s) the sampling interval.
    """
    real = abs(lam.imag) <= 1e-9 * max(1, abs(lam))
    return complex(np.log(max(abs(lam), 1e-300) if real else lam)) / T


def poles(fit: PemFit, T: float) -> list[Pole]:
    """Return the continuous-time poles log(λ)/T (rad/s) of a fit, with standard deviations.

    λ are the eigenvalues of the fit's discrete-time state matrix, T (s) is its sampling interval.
    """
    model = fit.model
    n, m, l = model.order, model.B.shape[1], len(model.C)
    lam, V = np.linalg.eig(model.A)
    W = np.linalg.inv(V)
    found = []
    for i in range(n):
        v, w = V[:, i], W[i]
        # Row vector of ∂λ/∂[Ã B K] and ∂λ/∂C
        rows = np.zeros((n, n + m + l), dtype=complex)
        rows[:, :n] = np.outer(w, v)
        rows[:, n + m :] = np.outer(w, model.C @ v)
        gradient = np.concatenate([rows.ravel(), np.outer(w @ model.K, v).ravel()])
        ds = (gradient @ fit.tangent) / (lam[i] * T)
        cov = np.vstack([ds.real, ds.imag]) @ fit.covariance @ np.vstack([ds.real, ds.imag]).T
        s = continuous_pole(lam[i], T)
        real = s.imag == 0
        std = np.sqrt(np.maximum(np.diag(cov), 0))
        found.append(Pole(s, float(std[0]), 0.0 if real else float(std[1])))
    return found


def propagate(fit: PemFit, f: Callable[[StateSpace], np.ndarray]) -> np.ndarray:
    """Return the covariance (q, q) of f(model) (q,), from that of the parameters of ``fit``."""
    std = np.sqrt(np.maximum(np.diag(fit.covariance), 0))
    columns = []
    for j, s in enumerate(std):
        h = 1e-3 * s if s > 0 else 0.0
        if h == 0.0:
            columns.append(np.zeros_like(f(fit.model)))
            continue
        up, down = (f(moved(fit.model, sign * h * fit.tangent[:, j])) for sign in (1, -1))
        columns.append((up - down) / (2 * h))
    F = np.array(columns).T
    return np.asarray(F @ fit.covariance @ F.T)


def in_continuous_time(model: StateSpace, T: float) -> Continuous:
    """Return the continuous-time form of a discrete-time model with the sampling interval T (s)."""
    A, B = continuous(model, T)
    return Continuous(A, B, model.C, np.zeros((len(model.C), B.shape[1])), "hold")


def response_std(fit: PemFit, T: float, omega: np.ndarray) -> np.ndarray:
    """Return the standard deviation (F, 3, 2) rad/V of the frequency response of ``fit``.

    T (s) is the sampling interval of ``fit``, ``omega`` (F,) in rad/s.
    """

    def parts(model: StateSpace) -> np.ndarray:
        G = in_continuous_time(model, T).response(omega).ravel()
        return np.concatenate([G.real, G.imag])

    var = np.diag(propagate(fit, parts)).reshape(2, len(omega), len(fit.model.C), -1).sum(axis=0)
    return np.asarray(np.sqrt(np.maximum(var, 0)))
