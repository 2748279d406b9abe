"""Predict the angles ``h`` samples ahead with any linear model.

A Kalman filter estimates the state x̂[k] = x̂[k|k−1] from earlier angles. From each such state the
model is propagated with the voltages recorded after it::

    x̂[k+1] = A x̂[k] + B ũ[k] + L_k (y[k] − y0 − C x̂[k])
    ŷ[k]   = y0 + C Aʰ⁻¹ x̂[k−h+1] + Σ_{i=0}^{h−2} C Aⁱ B ũ[k−1−i],      ũ = V − u0

The sum is a convolution with the first h − 1 samples of the impulse response, computed by FFT. The
model is not simulated from t = 0, because the plant integrates twice: 0.05 V of bias would cause
25° of drift in 10 s.

L_k is the time-varying Kalman gain from an uncertain initial state. After L_k has converged, its
limit is used. The noise that this Kalman gain assumes depends on the model:

* K ≠ 0, the innovation form: process noise K e, measurement noise e, cov e = S. If S is unknown,
  the encoder noise below replaces it. If every axis is measured, the limit is K itself.
* the hover model, for which the paper gives no noise: white angular acceleration of intensity
  `ACCELERATION`². Encoder noise is white, of variance step²/12 per sample. The intensity is large
  on purpose: the hover model's accelerations are off by tenths of rad/s² on a real rig. The filter
  must still follow the rates.
* any other model with K = 0 (output error): the same encoder noise. Process noise makes the free
  response drift by `DRIFT` rad/√s, independently of the state coordinates.

The filter ignores an axis that was never measured. If one angle is missing at a sample, the filter
predicts the state without a correction by this angle. Lost samples in a gap of at most
`heli3dof.model.estimation.filter_data.LOST` periods become rows without angles. The voltage in
these rows is that before the gap.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from heli3dof.model.compiled import compiled
from heli3dof.model.estimation.filter_data import LOST, hold_last
from heli3dof.model.linear.initial_state import rest_state, state_spread
from heli3dof.recording.gap_filling import fill_gaps
from heli3dof.recording.recording import Recording

if TYPE_CHECKING:
    from heli3dof.model.linear.model import LinearModel

ACCELERATION = np.array([0.05, 0.15, 0.05])
"""(3,) rad/s²/√Hz on roll, pitch, yaw, process noise for the hover model. Chosen as a compromise: a
simulated rig needs less noise, a real one more."""
DRIFT = 0.02
"""rad/√s, drift of the outputs that the process noise of output-error models causes"""
START = 0.1
"""rad, the initial standard deviation of the outputs (`state_spread`)."""
_SETTLE_S = 3.0
"""s, the time after which the Kalman gain is kept constant, if it has not converged before."""


def predict(model: LinearModel, recording: Recording, horizon_s: float) -> np.ndarray:
    """Return predicted angles (N, 3) rad; row k predicts the recorded ``angle[k]``.

    Row k uses voltages up to row k − 1 and angles up to row k − h; h is ``horizon_s`` in samples,
    at least one. The first h rows, and axes that are not modelled or measured, are NaN. Raises
    RecordingError if the sample interval is not the model's (`LinearModel.at`).
    """
    model = model.at(recording.dt)
    whole, own = fill_gaps(recording, LOST)
    if whole is not recording:
        return np.asarray(predict(model, whole, horizon_s)[own])
    N = len(recording)
    h = max(1, round(horizon_s / model.dt))
    axes = model.modelled & np.isfinite(recording.angle).any(axis=0)
    result = np.full((N, 3), np.nan)
    if not axes.any() or h >= N:
        return result
    u = hold_last(recording.voltage, model.u0) - model.u0
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
    """Return the Kalman filter's state estimates x̂[k|k−1] (N + 1, n), from angles before sample k.

    ``axes`` (3,) bool selects the angles to use. u (N, 2) V are the voltages minus the trim.
    """
    gains = kalman_gains(model, recording, axes)
    y = recording.angle - model.y0
    y = np.where(axes, y, np.nan)
    known = (column[np.isfinite(column)] for column in recording.angle.T)
    first = np.array([column[0] if len(column) else np.nan for column in known])
    x0 = rest_state(model, np.where(axes, first, np.nan))
    C = np.where(axes[:, None], model.C, 0.0)
    x = np.empty((len(y) + 1, model.order))
    x[0] = x0
    A, B, C, u, y = map(np.ascontiguousarray, (model.A, model.B, C, u, y))
    _follow(A, B, C, gains, u, y, x)
    return x


def kalman_gains(model: LinearModel, recording: Recording, axes: np.ndarray) -> np.ndarray:
    """Return the Kalman gains (M, n, 3) of the first M samples, until the gain has converged.

    Later samples use the last of these gains. n is the number of the model's states. ``axes`` (3,)
    bool selects the measured angles that correct the state.
    """
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
        out[-1] = model.K  # the exact limit of the recursion
    return out


def noise(
    model: LinearModel, recording: Recording, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the process (n, n), measurement (m, m) and cross (n, m) noise covariance per sample.

    n is the number of the model's states, m the number of axes that ``axes`` (3,) bool selects. The
    encoder steps are those of the recording's profile.
    """
    n, m, dt = model.order, int(axes.sum()), model.dt
    encoder = np.diag(recording.profile.encoder.rad_per_count[axes] ** 2 / 12)
    if model.K.any():
        S = np.where(np.isfinite(model.S), model.S, 0.0)
        if np.linalg.eigvalsh(S[np.ix_(axes, axes)]).min() <= 0:  # unknown
            S = np.diag(recording.profile.encoder.rad_per_count**2 / 12)
        K = model.K
        return K @ S @ K.T, S[np.ix_(axes, axes)], (K @ S)[:, axes]
    if model.physical_state:
        q = np.diag(ACCELERATION**2)
        Q = np.block([[q * dt**3 / 3, q * dt**2 / 2], [q * dt**2 / 2, q * dt]])
        return Q, encoder, np.zeros((n, m))
    return DRIFT**2 * dt * state_spread(model, axes), encoder, np.zeros((n, m))


def _forced(A: np.ndarray, B: np.ndarray, C: np.ndarray, u: np.ndarray, h: int) -> np.ndarray:
    """Return the effect (N, 3) of the last h − 1 inputs on predictions h samples ahead, in rad.

    Row k, the effect on the prediction of sample k, is Σ_{i=0}^{h−2} C Aⁱ B u[k−1−i]. u (N, 2):
    motor voltages minus trim, in V.
    """
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


@compiled
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
