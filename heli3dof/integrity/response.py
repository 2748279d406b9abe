"""Estimate each axis' response g to the voltages, by regression on the equations in weak form.

g is the acceleration that the voltages cause, divided by the profile's prediction of it. With roll
r, pitch p, yaw ψ, S = V_f + V_b, D = V_f − V_b (front, back; V), arm lengths L (m), thrust gain K_f
(N/V) and inertias at hover J (kg·m²), the profile predicts the accelerations (rad/s²)

    u_r = L_a K_f cos p S / J_r    u_p = L_h K_f D / J_p    u_ψ = −L_a K_f cos r sin p S / J_ψ

The model of each angle q (rad) has a rotor lag τ (s), damping b, and gravity and springs c_j x_j.
(x_1, x_2) is (cos r, sin r) for roll, (cos r cos p, sin p) for pitch, (1, ψ) for yaw:

    q̈ = g u − g τ u̇ + Σ c_j x_j(q) − b q̇ + noise

The equation is multiplied by φ(t) = (1 − (t/T)²)³ in time windows |t| < T = `HALF_WIDTH_S`. It is
integrated by parts, so that only φ is differentiated:

    ∫ φ̈ q = g ∫ φ u + g τ ∫ φ̇ u + Σ c_j ∫ φ x_j + b ∫ φ̇ q

Each window gives one equation. Ridge regression estimates g, with weak priors on g τ, c_j and b. It
needs the priors in closed loop: there, D is nearly proportional to p and ṗ, so the term g u is
nearly collinear with a spring and a damper.

A mass that is added in flight changes c_1 at one instant. The regression then needs one more
regressor: ∫ φ x_1 after this instant, and zero before it. `with_step` tries an instant every
`STEP_EVERY_S`, and selects the one whose regressor reduces the residual sum of squares most. It
adds this regressor if the reduction exceeds the share `STEP` of this sum.

Feedback biases g only through noise, towards zero. The standard deviation of g allows for
overlapping windows and coloured noise (Newey and West).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

HALF_WIDTH_S = 0.25
"""T, half the length of φ. Chosen, as are all constants below."""
PER_WIDTH = 2
"""Windows per half width."""
LEAST_WINDOWS = 8
STEP, STEP_EVERY_S, STEP_INSIDE_S = 0.5, 1.0, 3.0
"""`STEP`: least share of the residual sum of squares that a step of c_1 explains. `STEP_EVERY_S`:
interval between the instants tried, s. `STEP_INSIDE_S`: their least distance from the first and the
last time window, s."""
LAGS = 8
"""Largest lag, in windows, of the Newey-West estimate."""
PRIOR_LAG_S, PRIOR_SPRING, PRIOR_DAMPING = 0.15, 4.0, 1.5
"""Prior standard deviations of g τ (s), c_j (rad/s²) and b (1/s)."""


@dataclass(frozen=True)
class Response:
    """An axis' response g to the voltages, and the quality of this estimate.

    g is the acceleration that the voltages cause, divided by the profile's prediction of it.
    """

    gain: float
    """g"""
    std: float
    """Standard deviation of g"""
    explained: float
    """R² of the regression: share of the variance of ∫ φ̈ q that the model explains"""
    drive: float
    """rad/s², standard deviation of ∫ φ u, the acceleration that the profile predicts"""
    gravity: tuple[float, float] = (0.0, 0.0)
    """c_1, c_2 in rad/s²"""

    @property
    def level_rad(self) -> float:
        """Return, for roll, the logged angle (rad) at which the gravity torque is largest.

        The arm is level at this angle. The regression models the acceleration that gravity causes
        at the roll angle r as c_1 cos r + c_2 sin r. `gravity` contains c_1 and c_2 (rad/s²). The
        sum equals −A cos(r − r_level) with A > 0. The result is r_level = atan2(−c_2, −c_1).
        """
        c_1, c_2 = self.gravity
        return float(np.arctan2(-c_2, -c_1))

    @property
    def t(self) -> float:
        """Return the ratio of the response g to its standard deviation."""
        return self.gain / self.std if self.std > 0 else 0.0


def predicted_accelerations(angle: np.ndarray, voltage: np.ndarray, profile: Profile) -> np.ndarray:
    """Return the accelerations (N, 3) rad/s² that the voltages (N, 2) V cause on the profile's rig.

    Gravity is not included. ``angle`` (N, 3) is in rad.
    """
    g, K_f = profile.geometry, profile.motor.K_f
    J = profile.inertias
    r, p = angle[:, 0], angle[:, 1]
    S, D = voltage[:, 0] + voltage[:, 1], voltage[:, 0] - voltage[:, 1]
    lift = g.L_a * K_f * S
    return np.column_stack(
        [lift * np.cos(p) / J[0], g.L_h * K_f * D / J[1], -lift * np.cos(r) * np.sin(p) / J[2]]
    )


def responses(
    recording: Recording, usable: np.ndarray, number: np.ndarray, period_s: float
) -> dict[str, Response]:
    """Return {axis: its response g to the voltages}, with each g as a `Response`.

    g is the acceleration that the voltages cause, divided by the profile's prediction of it. The
    estimate uses only time windows in which all rows are usable. ``usable`` (N,) bool: the usable
    rows; ``number`` (N,): each row's sample number, which also counts lost samples; ``period_s``:
    sampling period. Axes that no voltage drives are left out.
    """
    angle, voltage, ok = _evenly_sampled(recording, usable, number)
    u = predicted_accelerations(angle, voltage, recording.profile)
    r, p, y = angle.T
    one = np.ones(len(r))
    slow = (
        [np.cos(r), np.sin(r)],
        [np.cos(r) * np.cos(p), np.sin(p)],
        [one, y - y.mean()],
    )
    windows = _Windows(len(r), period_s)
    if windows.count < LEAST_WINDOWS:
        return {}
    kept = windows.complete(ok)
    if kept.sum() < LEAST_WINDOWS:
        return {}
    result = {}
    for i, axis in enumerate(AXES):
        if axis not in recording.axes:
            continue
        phi, phi_dot, q = windows.phi, windows.phi_dot, angle[:, i]
        regressors = [
            (u[:, i], phi),
            (u[:, i], phi_dot),
            *((x, phi) for x in slow[i]),
            (q, phi_dot),
        ]
        X = np.column_stack([windows.integrals(*each) for each in regressors])[kept]
        z = windows.integrals(q, windows.phi_ddot)[kept]
        response = _fit(with_step(X, z, X[:, 2], windows.middle_s[kept]), z)
        if response is not None:
            result[axis] = response
    return result


def _evenly_sampled(
    recording: Recording, usable: np.ndarray, number: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return angles (M, 3), voltages (M, 2) and usable rows (M,), after insertion of lost samples.

    ``usable`` (N,) bool: usable rows; ``number`` (N,): each row's sample number, which also counts
    lost samples. The function interpolates the angles of a lost sample. It copies the sample's
    other values from the row before. NaN becomes 0. The control loop holds each voltage from one
    sample to the next, so one voltage acts before sample k and another one after it. Row k gets the
    mean of these two voltages.
    """
    angle, voltage = np.nan_to_num(recording.angle), np.nan_to_num(recording.voltage)
    if number[-1] + 1 != len(number) or (np.diff(number) != 1).any():
        all_n = np.arange(int(number[-1]) + 1)
        angle = np.column_stack([np.interp(all_n, number, a) for a in angle.T])
        last = np.searchsorted(number, all_n, side="right") - 1
        voltage, usable = voltage[last], usable[last]
    held = voltage.copy()
    held[1:] = 0.5 * (voltage[1:] + voltage[:-1])
    return angle, held, usable


class _Windows:
    """Computes the integral of x φ, x φ̇ or x φ̈ over each time window, for a signal x.

    φ: test function of the weak form, zero outside the window. x has n samples, ``dt`` s apart.
    """

    def __init__(self, n: int, dt: float) -> None:
        self.half = max(3, round(HALF_WIDTH_S / dt))
        self.step = max(1, self.half // PER_WIDTH)
        self.count = max(0, (n - 2 * self.half - 1) // self.step + 1)
        self.middle_s = (self.half + self.step * np.arange(self.count)) * dt
        x = np.arange(-self.half, self.half + 1) / self.half
        T, bump = self.half * dt, 1 - x**2
        norm = 1 / np.sum(bump**3)
        self.phi = bump**3 * norm
        self.phi_dot = -6 * x * bump**2 / T * norm
        ddot = (-6 * bump**2 + 24 * x**2 * bump) / T**2 * norm
        self.phi_ddot = ddot - ddot.mean()

    def integrals(self, x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
        """Return ∫ x ``kernel`` dt (windows,); ``kernel``: `phi`, `phi_dot` or `phi_ddot`."""
        rows = np.lib.stride_tricks.sliding_window_view(x, len(kernel))[:: self.step]
        return np.asarray(rows @ kernel)

    def complete(self, ok: np.ndarray) -> np.ndarray:
        """Return (windows,) bool: windows in which all rows are ``ok``."""
        return self.integrals((~ok).astype(float), np.ones(2 * self.half + 1)) < 0.5


def with_step(X: np.ndarray, z: np.ndarray, trim: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the regressors X (W, n), and one more if the trim torque changes in flight.

    The regression z = X c models the mean acceleration z (W,) of an axis in each of W time windows.
    The trim torque is the torque of gravity, or another nearly constant torque. ``trim`` (W,): its
    regressor, a column of X; ``t`` (W,): the middle of each window, s.

    The additional regressor equals ``trim`` after the instant of the change, and zero before it.
    The function selects the instant at which this regressor reduces the residual sum of squares
    most. It adds the regressor if the reduction exceeds the share `STEP` of this sum.
    """
    times = np.arange(t[0] + STEP_INSIDE_S, t[-1] - STEP_INSIDE_S, STEP_EVERY_S)
    if not len(times):
        return X
    steps = np.where(t[:, None] > times, trim[:, None], 0.0)
    Q = np.linalg.qr(X)[0]
    residual = z - Q @ (Q.T @ z)
    orthogonal = steps - Q @ (Q.T @ steps)
    size = np.maximum(np.einsum("wj,wj->j", orthogonal, orthogonal), 1e-12)
    explained = (residual @ orthogonal) ** 2 / size
    best = int(np.argmax(explained))
    significant = explained[best] > STEP * (residual @ residual)
    return np.column_stack([X, steps[:, best]]) if significant else X


def _fit(X: np.ndarray, z: np.ndarray) -> Response | None:
    """Return an axis' response g to the voltages, estimated by ridge regression.

    The regression z = X c models the mean acceleration z (W,) of the axis in each of W time
    windows. X (W, n) contains the regressors, c (n,) the coefficients. The first regressor is the
    acceleration that the voltages cause according to the profile, so its coefficient is g. The
    result is None if no voltage drives the axis, or if the axis does not move.
    """
    drive = float(np.std(X[:, 0]))
    spread = float(np.std(z))
    if drive < 1e-9 or spread == 0:
        return None
    prior = np.array([np.inf, PRIOR_LAG_S, PRIOR_SPRING, PRIOR_SPRING, PRIOR_DAMPING])
    prior = np.append(prior, [PRIOR_SPRING] * (X.shape[1] - len(prior)))
    noise = spread**2
    for _ in range(3):
        # Windows overlap: about one in PER_WIDTH is independent.
        A = X.T @ X + np.diag(noise * PER_WIDTH / prior**2)
        inverse = np.linalg.pinv(A)
        c = inverse @ (X.T @ z)
        e = z - X @ c
        noise = float(e @ e) / max(len(z) - len(c), 1)
    G = X * e[:, None]
    W = G.T @ G
    for lag in range(1, min(LAGS, len(z) // 4) + 1):
        C = G[lag:].T @ G[:-lag]
        W += (1 - lag / (LAGS + 1)) * (C + C.T)
    variance = float((inverse @ W @ inverse)[0, 0])
    std = float(np.sqrt(max(variance, 0.0)))
    gravity = (float(c[2]), float(c[3]))
    return Response(float(c[0]), std, 1 - noise / spread**2, drive, gravity)
