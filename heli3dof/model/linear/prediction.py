"""Prediction ``h`` samples ahead from data so far, for any linear model.

A causal filter follows the state, x̂ = x̂[k|k−1], through the measured angles, and each prediction
rolls the model forward from it through the voltages that followed::

    x̂[k+1] = A x̂[k] + B ũ[k] + L_k (y[k] − y0 − C x̂[k])
    ŷ[k]   = y0 + C Aʰ⁻¹ x̂[k−h+1] + Σ_{i=0}^{h−2} C Aⁱ B ũ[k−1−i],      ũ = V − u0

The sum is a convolution with the first h − 1 impulse responses, so 60 s at 500 Hz take the time
of a few Fourier transforms whatever the horizon. Voltages are never replayed from t = 0: the plant
integrates twice, and 0.05 V of bias drifts 25° in 10 s.

L_k is the time-varying Kalman gain from an uncertain start, then its limit. The noise it assumes:

* K ≠ 0, the innovation form: process noise K e, measurement noise e, cov e = S. With every axis
  measured the limit is K itself.
* the physical state (hover), of which the paper says no noise: white angular acceleration of
  intensity ``ACCELERATION``², and encoder steps as white noise of variance step²/12 per sample.
  The intensity is chosen fast rather than quiet: the hover model's accelerations are wrong by
  tenths of rad/s² on a real rig, and the rates must be found in spite of them.
* any other model with K = 0 (output error): the same encoder noise, and a drift of the free
  response by ``DRIFT`` rad/√s, which is the same in every basis.

An axis without readings has no part in the filter; a lost reading is skipped, and so are samples
of which the whole row is lost, up to a gap that the other filter does not cross either
(`heli3dof.model.estimation.filter_data.LOST`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.filter_data import LOST
from heli3dof.model.linear.initial_state import state_spread
from heli3dof.recording.gap_filling import bridged
from heli3dof.recording.recording import Recording

if TYPE_CHECKING:
    from heli3dof.model.linear.model import LinearModel

ACCELERATION = np.array([0.05, 0.15, 0.05])
"""(3,) rad/s² per √Hz: roll, pitch, yaw. A compromise: half of it suits a rig that is the model
better (0.1° less at 1 s), twice of it a real one (2 % less at 1 s on the real recordings)."""
DRIFT = 0.02
"""rad/√s"""
START = 0.1
"""rad, how uncertain the first outputs are."""
_SETTLE_S = 3.0  # the gain varies for at most this long


def predict(model: LinearModel, recording: Recording, horizon_s: float) -> np.ndarray:
    """(N, 3) rad: row k is the prediction of ``angle[k]`` made ``horizon_s`` earlier.

    Uses voltages up to k − 1 and angles up to k − h, h the horizon in samples (at least one). NaN
    for the first h rows and for an axis that is not modelled or was not measured. Raises
    RecordingError where the sample interval is not the model's; see `LinearModel.at`.
    """
    model = model.at(recording.dt)
    whole, own = bridged(recording, LOST)
    if whole is not recording:
        return np.asarray(predict(model, whole, horizon_s)[own])
    N = len(recording)
    h = max(1, round(horizon_s / model.dt))
    axes = model.modelled & np.isfinite(recording.angle).any(axis=0)
    result = np.full((N, 3), np.nan)
    if not axes.any() or h >= N:
        return result
    u = _held(recording.voltage, model.u0) - model.u0
    x = filtered_states(model, recording, axes, u)
    C = np.where(axes[:, None], model.C, 0.0)
    forward = C @ np.linalg.matrix_power(model.A, h - 1)
    y = x[1 : N - h + 1] @ forward.T + model.y0
    if h > 1:
        y = y + _forced(model.A, model.B, C, u, h)[h:]
    result[h:] = y
    result[:, ~axes] = np.nan
    return result


def filtered_states(
    model: LinearModel, recording: Recording, axes: np.ndarray, u: np.ndarray
) -> np.ndarray:
    """(N + 1, n): row k is x̂[k|k−1], the state before sample k is read. u is V − u0 (N, 2)."""
    from heli3dof.model.linear.initial_state import rest_state

    gains = kalman_gains(model, recording, axes)
    y = recording.angle - model.y0
    y = np.where(axes, y, np.nan)
    first = np.array([_first(recording.angle[:, i]) for i in range(3)])
    x0 = rest_state(model, np.where(axes, first, np.nan))
    C = np.where(axes[:, None], model.C, 0.0)
    x = np.empty((len(y) + 1, model.order))
    x[0] = x0
    _follow_compiled(
        np.ascontiguousarray(model.A),
        np.ascontiguousarray(model.B),
        np.ascontiguousarray(C),
        gains,
        np.ascontiguousarray(u),
        np.ascontiguousarray(y),
        x,
    )
    return x


def kalman_gains(model: LinearModel, recording: Recording, axes: np.ndarray) -> np.ndarray:
    """(M, n, 3): the predictor's gain at samples 0 … M − 1, the last one from then on."""
    Q, R, cross = noise(model, recording, axes)
    A, C = model.A, model.C[axes]
    P = START**2 * state_spread(model, axes)
    limit = min(len(recording), max(2, int(_SETTLE_S / model.dt)))
    picked = np.nonzero(axes)[0]
    gains: list[np.ndarray] = []
    for _ in range(limit):
        PC = P @ C.T
        innovation = C @ PC + R
        L = np.linalg.solve(innovation, (A @ PC + cross).T).T
        gains.append(L)
        P = A @ P @ A.T + Q - L @ innovation @ L.T
        P = (P + P.T) / 2
        if len(gains) > 1 and abs(L - gains[-2]).max() <= 1e-7 * abs(L).max():
            break
    out = np.zeros((len(gains), model.order, 3))
    out[:, :, picked] = gains
    if model.K.any() and axes.all():
        out[-1] = model.K  # where the recursion tends to, exactly
    return out


def noise(
    model: LinearModel, recording: Recording, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(Q, R, cross): process (n, n), measurement (m, m) and cross (n, m) covariance per sample."""
    n, m, dt = model.order, int(axes.sum()), model.dt
    encoder = np.diag(recording.profile.encoder.rad_per_count[axes] ** 2 / 12)
    if model.K.any():
        S = np.where(np.isfinite(model.S), model.S, 0.0)
        if np.linalg.eigvalsh(S[np.ix_(axes, axes)]).min() <= 0:  # not known
            S = np.diag(recording.profile.encoder.rad_per_count**2 / 12)
        K = model.K
        return K @ S @ K.T, S[np.ix_(axes, axes)], (K @ S)[:, axes]
    if model.physical_state:
        q = np.diag(ACCELERATION**2)
        Q = np.block([[q * dt**3 / 3, q * dt**2 / 2], [q * dt**2 / 2, q * dt]])
        return Q, encoder, np.zeros((n, m))
    return DRIFT**2 * dt * state_spread(model, axes), encoder, np.zeros((n, m))


def _forced(A: np.ndarray, B: np.ndarray, C: np.ndarray, u: np.ndarray, h: int) -> np.ndarray:
    """(N, 3): row k is Σ_{i=0}^{h−2} C Aⁱ B u[k−1−i], by fast convolution."""
    taps = np.empty((h - 1, 3, 2))
    AB = B
    for i in range(h - 1):
        taps[i] = C @ AB
        AB = A @ AB
    N = len(u)
    size = 1 << (N + h).bit_length()
    response, input_ = np.fft.rfft(taps, size, axis=0), np.fft.rfft(u, size, axis=0)
    spectrum = np.einsum("fij,fj->fi", response, input_)
    y = np.zeros((N, 3))
    y[1:] = np.fft.irfft(spectrum, size, axis=0)[: N - 1]
    return y


def _follow(A, B, C, gains, u, y, x):  # type: ignore[no-untyped-def]
    n = A.shape[0]
    last = gains.shape[0] - 1
    for k in range(y.shape[0]):
        L = gains[min(k, last)]
        for i in range(n):
            acc = B[i, 0] * u[k, 0] + B[i, 1] * u[k, 1]
            for j in range(n):
                acc += A[i, j] * x[k, j]
            x[k + 1, i] = acc
        for axis in range(3):
            e = y[k, axis]
            for j in range(n):
                e -= C[axis, j] * x[k, j]
            if e == e:
                for i in range(n):
                    x[k + 1, i] += L[i, axis] * e


_follow_compiled = compiled(_follow)


def _held(voltage: np.ndarray, u0: np.ndarray) -> np.ndarray:
    """Lost voltages replaced by the last known one; before the first, the trim."""
    if np.isfinite(voltage).all():
        return voltage
    v = voltage.copy()
    for j in range(v.shape[1]):
        good = np.isfinite(v[:, j])
        index = np.maximum.accumulate(np.where(good, np.arange(len(v)), -1))
        v[:, j] = np.where(index >= 0, v[index, j], u0[j])
    return v


def _first(column: np.ndarray) -> float:
    good = np.nonzero(np.isfinite(column))[0]
    return float(column[good[0]]) if len(good) else np.nan
