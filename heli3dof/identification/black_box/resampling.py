"""Resample a fit at a decimated rate to the control rate, via continuous time.

A and B were fitted at the interval T (s), which is q control periods dt. They become A^{1/q} and
the matching B, by the matrix logarithm of [A B; 0 I]. The responses agree exactly at the instants
of the fit, unless A has a real eigenvalue λ ≤ 0.001. Such an eigenvalue has no usable logarithm:

* λ ≥ −0.5: its mode is replaced by one at |λ| (at least 0.001) with the same static gain.
* λ < −0.5: the mode decays too slowly to be replaced, and the fit is rejected.

The predictor gain is computed again. Let K_T be the gain of the fit, and S the covariance of its
innovations e. During an interval T, the process noise has the covariance K_T S K_Tᵀ. Each of the q
control periods gets an equal share of it. The new gain K is the Kalman gain for this process noise
and the output noise S. On held-out flights the resampled model predicts 0.1 to 2.5 s ahead as well
as the fit at the decimated rate.

The fit's constant output offset d is replaced by trims y0 (rad) and u0 (V). In control period k,
the resampled model is

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k],  y[k] = C x[k] + y0 + e[k]

The constant part of the one-step prediction stays the same. Many pairs (y0, u0) have this property.
`trims` takes the one with the least ‖δy0‖² + ‖δu0/20‖², where δ is the change from the data's
means. The 20 is the weight `VOLT_FOR_RADIAN`.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.black_box.pbsid import StateSpace
from heli3dof.identification.black_box.stabilisation import kalman_gain, with_stable_predictor
from heli3dof.model.discretisation import c2d_zoh, d2c_zoh

FASTEST = 1e-3
"""A real eigenvalue λ of A that does not exceed this value is replaced by max(|λ|, this value)."""
SLOWEST_NEGATIVE = -0.5
"""A real eigenvalue of A below this has no continuous equivalent; the fit is rejected."""
WELL_CONDITIONED = 1e6
"""Condition number of A's eigenvector matrix below which eigenvalues are converted one by one"""
VOLT_FOR_RADIAN = 20.0
"""V: a trim change of this many volts has the same weight as a change of 1 rad."""


class NoContinuousModel(ValueError):
    """Raised if a discrete-time model has no continuous-time equivalent.

    The usual cause is a real pole z between −1 and `SLOWEST_NEGATIVE` (−0.5). Its mode changes sign
    at every sample and decays slowly. A real pole of a continuous-time model cannot cause this.
    """


def with_real_logarithm(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A (n, n) and B (n, m) of a discrete-time model, changed so that ln A is real.

    ln A is not real if A has a negative eigenvalue. Every real eigenvalue λ ≤ `FASTEST` (0.001) is
    replaced by max(|λ|, `FASTEST`). B is changed so that the model's static gain stays the same.
    Raises NoContinuousModel if a real eigenvalue is below `SLOWEST_NEGATIVE` (−0.5).
    """
    lam, V = np.linalg.eig(A)
    real = np.abs(lam.imag) <= 1e-9 * np.maximum(1, np.abs(lam))
    bad = (lam.real <= FASTEST) & real
    if not bad.any():
        return A, B
    if (lam.real[bad] < SLOWEST_NEGATIVE).any():
        raise NoContinuousModel(f"a mode at z = {lam.real[bad].min():.3f}")
    new = np.where(bad, np.maximum(np.abs(lam), FASTEST), lam)
    gain = np.where(bad, (1 - new) / np.where(bad, 1 - lam, 1), 1)
    Vi = np.linalg.inv(V)
    return np.real(V * new @ Vi), np.real(V * gain @ Vi @ B)


def continuous(model: StateSpace, T: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the continuous-time A and B of a model whose sampling interval is T (s).

    In modal coordinates, an eigenvalue z becomes s = log(z)/T, and the mode's row b of B becomes
    b s/(z − 1). If eigenvalues nearly coincide, the matrix logarithm is used instead. Raises
    NoContinuousModel if the model has no continuous equivalent.
    """
    A, B = with_real_logarithm(model.A, model.B)
    z, V = np.linalg.eig(A)
    if np.linalg.cond(V) < WELL_CONDITIONED:
        z = z.astype(complex)
        s = np.log(z) / T
        # s/(z − 1) → 1/T as z → 1 (a pure integrator)
        one = np.abs(z - 1) < 1e-12
        gain = np.where(one, 1 / T, s / np.where(one, 1, z - 1))
        Vi = np.linalg.inv(V)
        return np.real(V * s @ Vi), np.real(V * gain @ Vi @ B)
    found = d2c_zoh(A, B, T)
    if found is None:
        raise NoContinuousModel("its matrix has no real logarithm")
    return found


def at_rate(model: StateSpace, T: float, dt: float) -> StateSpace:
    """Return the model resampled from T (s) to dt (s); raise NoContinuousModel if impossible."""
    A, B = c2d_zoh(*continuous(model, T), dt)
    if not model.K.any():
        return replace(model, A=A, B=B)
    Q = model.K @ model.S @ model.K.T * (dt / T)
    Q = Q + 1e-6 * np.trace(Q) * np.eye(model.order)
    K = kalman_gain(A, model.C, Q, model.S)
    return with_stable_predictor(
        replace(model, A=A, B=B, K=model.K * (dt / T) if K is None else K), rho=1 - 1e-6
    )


def trims(
    model: StateSpace, u_mean: np.ndarray, y_mean: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return trims u0 (2,) V and y0 (3,) rad that replace the model's constant output offset d.

    The model describes deviations from the data's means, u_mean (2,) V and y_mean (3,) rad. A, B, C
    and the predictor's gain K are the matrices of ``model``. The trims differ from the means by δu0
    and δy0, which solve

        min ‖δy0‖² + ‖δu0/20‖²   subject to   [I − C G K] δy0 − C G B δu0 = d
        G = (I − Ã)⁻¹,  Ã = A − K C

    The 20 is the weight `VOLT_FOR_RADIAN`.
    """
    n, l = model.order, len(model.C)
    CG = model.C @ np.linalg.pinv(np.eye(n) - model.At)
    M = np.hstack([np.eye(l) - CG @ model.K, -CG @ model.B])
    scale = np.concatenate([np.ones(l), np.full(model.B.shape[1], VOLT_FOR_RADIAN)])
    delta = scale * np.linalg.lstsq(M * scale, model.d, rcond=1e-6)[0]
    return u_mean + delta[l:], y_mean + delta[:l]
