"""From a fit at a decimated rate to a `LinearModel` at the control rate, exactly.

A, B at the interval T = q dt become A^{1/q} and the matching B by way of continuous time (the
matrix logarithm of [A B; 0 I]). A mode on the negative real axis or at zero has no logarithm; it
has died within one interval, and is replaced by one at |λ| (at least 0.001) with the same gain
at zero frequency. The noise gain at the control rate is the Kalman gain for the process noise
K S Kᵀ spread evenly over the q samples: measured on held-out flights it predicts 0.1 to 2.5 s
ahead as well as the fit at its own rate does, and better than a K fitted to single 2 ms steps,
where the encoder's grid is most of what is left to explain.

The predictor's offset d becomes trims: y0 and u0 such that the predictor of

    x[k+1] = A x[k] + B (V[k] − u0) + K e[k],  y[k] = C x[k] + y0 + e[k]

has the same constant term; of all such pairs, the smallest change (yaw integrates, so its offset
is carried by pitch and the voltages).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.black_box.pbsid import StateSpace
from heli3dof.identification.black_box.stabilisation import kalman_gain, with_stable_predictor
from heli3dof.model.discretisation import held, released

FASTEST = 1e-3
"""Modes with z below this have died within one sample."""
SLOWEST_NEGATIVE = -0.5
WELL_CONDITIONED = 1e6
VOLT_FOR_RADIAN = 20.0
"""V of trim that count as much as 1 rad of trim, in the smallest change."""


class NoContinuousModel(ValueError):
    """The fit has a mode that rings at half its sampling rate: no continuous model matches it."""


def with_real_logarithm(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """A, B with modes that have no logarithm replaced, and how many were.

    Raises NoContinuousModel where such a mode is slow (z below −0.5).
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

    Mode by mode, s = log(z)/T and b_s = b_z s/(z − 1), which is fast enough to differentiate by;
    by the matrix logarithm where modes nearly coincide.
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
    found = released(A, B, T)
    if found is None:
        raise NoContinuousModel("its matrix has no real logarithm")
    return found


def at_rate(model: StateSpace, T: float, dt: float) -> StateSpace:
    """The model of interval T (s) at the interval dt (s)."""
    A, B = held(*continuous(model, T), dt)
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
    """(u0, y0) that stand for the offset d about the means that were taken off the data.

    With G = (I − Ã)⁻¹:  [I − C G K] δy0 − C G B δu0 = d.
    """
    n, l = model.order, len(model.C)
    CG = model.C @ np.linalg.pinv(np.eye(n) - model.At)
    M = np.hstack([np.eye(l) - CG @ model.K, -CG @ model.B])
    scale = np.concatenate([np.ones(l), np.full(model.B.shape[1], VOLT_FOR_RADIAN)])
    delta = scale * np.linalg.lstsq(M * scale, model.d, rcond=1e-6)[0]
    return u_mean + delta[l:], y_mean + delta[:l]
