"""How an axis answers the voltages, as a multiple g of what the profile says. No derivative.

With S = V_f + V_b, D = V_f − V_b (V) and the profile's lengths and level inertias::

    u_r = L_a K_f cos p S / J_r    u_p = L_h K_f D / J_p    u_ψ = −L_a K_f cos r sin p S / J_ψ

each axis should obey, whatever else acts slowly (rad, s)::

    q̈ = g u − g τ u̇ + Σ c_j x_j(q) − b q̇ + noise

τ is a lag of the rotors to first order, x_j gravity and springs: cos r, sin r for roll, cos r cos p
and sin p for pitch, 1 and ψ for yaw. Multiplied by a bump φ(t) = (1 − (t/T)²)³ of half width T and
integrated by parts, all derivatives fall on φ::

    ∫ φ̈ q = g ∫ φ u + g τ ∫ φ̇ u + Σ c_j ∫ φ x_j + b ∫ φ̇ q

one equation per window, least squares over the flight, with weak priors on τ g, c and b: in closed
loop with little excitation D is a multiple of p and ṗ, and a spring of any size would do as well.
A mass that is added or lost in flight is a step in the first x_j: of a step at each second the one
that explains most is taken as one more regressor, where it explains more than `STEP` of the rest.
The voltages are known, so feedback does no harm except through noise, which draws g towards zero.
The standard deviation allows for overlapping windows and coloured noise (Newey and West).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile

HALF_WIDTH_S = 0.25
PER_WIDTH = 2
"""Windows per half width."""
LEAST_WINDOWS = 8
STEP, STEP_EVERY_S, STEP_INSIDE_S = 0.5, 1.0, 3.0
"""Share of the rest that a trim's step must explain; where one is tried, and how far inside."""
LAGS = 8
"""Windows over which the equations' noise is correlated, at most."""
PRIOR_LAG_S, PRIOR_SPRING, PRIOR_DAMPING = 0.15, 4.0, 1.5
"""Prior standard deviations: s; rad/s² per unit of a regressor with a spring's size; 1/s."""


@dataclass(frozen=True)
class Response:
    """g ± std of one axis."""

    gain: float
    std: float
    explained: float
    """R²: share of the second differences' variance that the equation explains"""
    drive: float
    """rad/s², standard deviation of what the voltages should do"""

    @property
    def t(self) -> float:
        """g in standard deviations."""
        return self.gain / self.std if self.std > 0 else 0.0


def driven(angle: np.ndarray, voltage: np.ndarray, profile: Profile) -> np.ndarray:
    """(N, 3) rad/s²: u of each axis from angles (N, 3) rad and voltages (N, 2) V."""
    g, K_f = profile.geometry, profile.motor.K_f
    J = profile.inertias
    r, p = angle[:, 0], angle[:, 1]
    S, D = voltage[:, 0] + voltage[:, 1], voltage[:, 0] - voltage[:, 1]
    lift = g.L_a * K_f * S
    return np.column_stack(
        [lift * np.cos(p) / J[0], g.L_h * K_f * D / J[1], -lift * np.cos(r) * np.sin(p) / J[2]]
    )


def responses(
    recording: Recording, free: np.ndarray, number: np.ndarray, period_s: float
) -> dict[str, Response]:
    """Axis → `Response`, over windows of rows that are ``free`` (N,) to move.

    ``number`` (N,) counts the samples, lost ones too; these are filled in by straight lines.
    """
    angle, voltage, ok = _even(recording, free, number)
    u = driven(angle, voltage, recording.profile)
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
    kept = windows.whole(ok)
    if kept.sum() < LEAST_WINDOWS:
        return {}
    found = {}
    for i, axis in enumerate(AXES):
        if axis not in recording.axes:
            continue
        columns = [windows.over(u[:, i]), windows.dot(u[:, i])]
        columns += [windows.over(x) for x in slow[i]]
        columns += [windows.dot(angle[:, i])]
        X = np.column_stack(columns)[kept]
        z = windows.ddot(angle[:, i])[kept]
        answer = _fit(with_step(X, z, X[:, 2], windows.middle_s[kept]), z)
        if answer is not None:
            found[axis] = answer
    return found


def _even(
    recording: Recording, free: np.ndarray, number: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles, voltages and ``free`` with one row per sample that should be there, NaN as zero.

    A voltage k is held until k + 1: its mean over the samples' own places is half a row later.
    """
    angle, voltage = np.nan_to_num(recording.angle), np.nan_to_num(recording.voltage)
    if number[-1] + 1 != len(number) or (np.diff(number) != 1).any():
        all_n = np.arange(int(number[-1]) + 1)
        angle = np.column_stack([np.interp(all_n, number, a) for a in angle.T])
        last = np.searchsorted(number, all_n, side="right") - 1
        voltage, free = voltage[last], free[last]
    held = voltage.copy()
    held[1:] = 0.5 * (voltage[1:] + voltage[:-1])
    return angle, held, free


class _Windows:
    """Integrals over the bump φ and its derivatives, window by window."""

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

    def _apply(self, x: np.ndarray, kernel: np.ndarray) -> np.ndarray:
        rows = np.lib.stride_tricks.sliding_window_view(x, len(kernel))[:: self.step]
        return np.asarray(rows @ kernel)

    def over(self, x: np.ndarray) -> np.ndarray:
        return self._apply(x, self.phi)

    def dot(self, x: np.ndarray) -> np.ndarray:
        return self._apply(x, self.phi_dot)

    def ddot(self, x: np.ndarray) -> np.ndarray:
        return self._apply(x, self.phi_ddot)

    def whole(self, ok: np.ndarray) -> np.ndarray:
        """(windows,) bool: every row of the window is ok."""
        return self._apply((~ok).astype(float), np.ones(2 * self.half + 1)) < 0.5


def with_step(X: np.ndarray, z: np.ndarray, trim: np.ndarray, t: np.ndarray) -> np.ndarray:
    """X (W, n), and where it explains most of the rest a step of ``trim`` (W,) at an instant.

    ``t`` (W,) s, of the windows' middles.
    """
    at = np.arange(t[0] + STEP_INSIDE_S, t[-1] - STEP_INSIDE_S, STEP_EVERY_S)
    if not len(at):
        return X
    steps = np.where(t[:, None] > at, trim[:, None], 0.0)
    Q = np.linalg.qr(X)[0]
    rest = z - Q @ (Q.T @ z)
    new = steps - Q @ (Q.T @ steps)
    size = np.maximum(np.einsum("wj,wj->j", new, new), 1e-12)
    explained = (rest @ new) ** 2 / size
    best = int(np.argmax(explained))
    return np.column_stack([X, steps[:, best]]) if explained[best] > STEP * (rest @ rest) else X


def _fit(X: np.ndarray, z: np.ndarray) -> Response | None:
    """Ridge with the priors; g is the first coefficient. None where nothing drives the axis."""
    drive = float(np.std(X[:, 0]))
    spread = float(np.std(z))
    if drive < 1e-9 or spread == 0:
        return None
    prior = np.array([np.inf, PRIOR_LAG_S, PRIOR_SPRING, PRIOR_SPRING, PRIOR_DAMPING])
    prior = np.append(prior, [PRIOR_SPRING] * (X.shape[1] - len(prior)))
    noise = spread**2
    for _ in range(3):
        # Overlapping windows are worth about one in PER_WIDTH.
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
    return Response(float(c[0]), float(np.sqrt(max(variance, 0.0))), 1 - noise / spread**2, drive)
