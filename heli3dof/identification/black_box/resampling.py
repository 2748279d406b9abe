"""From a fit at a decimated rate to a `LinearModel` at the control rate, exactly.

A, B at the interval T = q dt become A^{1/q} and the matching B via continuous time (the matrix
logarithm of [A B; 0 I]). A mode on the negative real axis or at zero has no logarithm. It decays
within one interval, so a mode at |λ| (at least 0.001) with the same static gain replaces it.

The gain K at the control rate is the Kalman gain for the process noise K S Kᵀ spread evenly over
the q samples. On held-out flights it predicts 0.1 to 2.5 s ahead as well as the fit at its own
rate, and better than a K fitted at 2 ms, where the encoders' grid dominates the innovations.

The predictor's offset d becomes trims: y0 and u0 such that the predictor of

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k],  y[k] = C x[k] + y0 + e[k]

has the same constant term. Of all such pairs, the smallest change is taken (yaw integrates, so its
offset is carried by pitch and the voltages).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.black_box.pbsid import StateSpace
from heli3dof.identification.black_box.stabilisation import kalman_gain, with_stable_predictor
from heli3dof.model.discretisation import c2d_zoh, d2c_zoh

FASTEST = 1e-3
"""A mode with z below this decays within one sample."""
SLOWEST_NEGATIVE = -0.5
"""A mode with z below this has no continuous equivalent."""
WELL_CONDITIONED = 1e6
"""Condition of the eigenvectors below which modes are converted one by one."""
VOLT_FOR_RADIAN = 20.0
"""V of trim that weigh as much as 1 rad, where the smallest trim change is chosen."""


class NoContinuousModel(ValueError):
    """The fit has a slow mode at half its sampling rate, which no continuous model has."""


def with_real_logarithm(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """A, B with modes without a logarithm replaced, and the number of those modes.

    Raises NoContinuousModel if such a mode is slow (z below `SLOWEST_NEGATIVE`).
    """
    lam, V = np.linalg.eig(A)
    real = np.abs(lam.imag) <= 1e-9 * np.maximum(1, np.abs(lam))
    bad = (lam.real <= FASTEST) & real
    if not bad.any():
        return A, B, 0
    if (lam.real[bad] < SLOWEST_NEGATIVE).any():
        raise NoContinuousModel(f"a mode at z = {lam.real[bad].min():.3f}")
    new = np.where(bad, np.maximum(np.abs(lam), FASTEST), lam)
    gain = np.where(bad, (1 - new) / np.where(bad, 1 - lam, 1), 1)
    Vi = np.linalg.inv(V)
    return np.real(V * new @ Vi), np.real(V * gain @ Vi @ B), int(bad.sum())


def continuous(model: StateSpace, T: float) -> tuple[np.ndarray, np.ndarray]:
    """(A, B) in continuous time of a model at interval T (s). Raises NoContinuousModel.

    Mode by mode, s = log(z)/T and b_s = b_z s/(z − 1), which is fast; by the matrix logarithm where
    modes nearly coincide.
    """
    A, B, _ = with_real_logarithm(model.A, model.B)
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
    """The model of interval T (s), resampled to dt (s)."""
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
    """(u0, y0): trims equivalent to the offset d about the subtracted means of the data.

    With G = (I − Ã)⁻¹:  [I − C G K] δy0 − C G B δu0 = d.
    """
    n, l = model.order, len(model.C)
    CG = model.C @ np.linalg.pinv(np.eye(n) - model.At)
    M = np.hstack([np.eye(l) - CG @ model.K, -CG @ model.B])
    scale = np.concatenate([np.ones(l), np.full(model.B.shape[1], VOLT_FOR_RADIAN)])
    delta = scale * np.linalg.lstsq(M * scale, model.d, rcond=1e-6)[0]
    return u_mean + delta[l:], y_mean + delta[:l]
