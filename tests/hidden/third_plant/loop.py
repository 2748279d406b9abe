"""The flight: integration, encoders, controller, and the predictions that measure an effect.

A Runge-Kutta step of order 4 integrates the state x = (q, q̇, F_f, F_b); τ_m Ḟ = F_static − F is the
motors' lag. Dry friction and backlash act after each step. The random torques are correlated over
τ_c: n ← e^(−dt/τ_c) n + σ √(1 − e^(−2 dt/τ_c)) g, with σ² τ_c the same for all τ_c.

Each period T, with the readings y (rad), s the bilinear transform's and the gains K (2, 8)::

    r ← r + clip(r_ref − r, ± 45°/s T)              ω = y s ω_c² / (s² + 2 ζ ω_c s + ω_c²)
    I ← clip(I + T (e_r, e_ψ), ± 7.5 V / |K_i|)     e = r − y
    V = V_o + K (e_r, e_p, e_ψ, −ω_r, −ω_p, −ω_ψ, I_r, I_ψ) + V_extra,   limited to ± v_max

Readings are whole counts, rounded or truncated. The controller may add half a count to them, and
may advance the integrals before or after it computes V (`Loop`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tests.hidden.third_plant import body, effects, kernel

V_MAX = 24.0
COUNTS = (4096, 4096, 8192)
STEP_RAD = 2 * np.pi / np.array(COUNTS)
_GAINS = np.array([37.6707, 13.2126, -11.4978, 20.9542, 4.7687, -16.0993, 10.0, -1.0])
GAINS = np.array([_GAINS, _GAINS * (1, -1, -1, 1, -1, -1, 1, -1)])
"""The paper's controller; the profile's is the printed one, rounded to 0.1"""
CUTOFF, DAMPING = 2 * math.pi * 20.0, 0.9
REFERENCE_RATE = math.radians(45.0)
INTEGRAL_V = 7.5
NOISE_NM = np.array([0.006, 0.0015, 0.006]) * math.sqrt(0.2)
"""N·m·√s, σ √τ_c of the random torques on roll, pitch and yaw"""
INTEGRATION_S, LEAST_SUBSTEPS = 5e-4, 4
SETTLE_S, AVERAGE_S = 40.0, 8.0
"""A flight starts from the mean of the last 8 s of 40 s without noise"""
LEFT = (1.3, 1.3, 30.0)
"""rad: beyond these angles a flight ends"""


@dataclass(frozen=True)
class Loop:
    """Sample rate and variants of a laboratory's loop."""

    rate_hz: int
    rounds: bool
    half_count: bool
    integrals_first: bool

    @property
    def substeps(self) -> int:
        """Integration steps per period."""
        return max(LEAST_SUBSTEPS, round(1 / (self.rate_hz * INTEGRATION_S)))

    @property
    def dt(self) -> float:
        return 1 / (self.rate_hz * self.substeps)


@dataclass(frozen=True)
class Task:
    """What is flown: references (n, 3) in rad, added voltages (n, 2), random torques per step.

    The first ``lead`` periods are flown before the log begins at t = 0.
    """

    reference: np.ndarray
    extra: np.ndarray
    noise: np.ndarray
    lead: int

    def scaled(self, factor: float) -> Task:
        """The task with smaller references."""
        return replace(self, reference=factor * self.reference)


@dataclass(frozen=True)
class Log:
    """A flight, lead included: the voltages before its start (2,), those behind and before the
    limiter (n, 2), readings (n, 3), states (n, 8), encoder shafts (n, 3), integrals (n, 2)."""

    before_V: np.ndarray
    voltage: np.ndarray
    command: np.ndarray
    reading: np.ndarray
    state: np.ndarray
    seen: np.ndarray
    integral: np.ndarray


@kernel
def _derivative(
    x: np.ndarray, t: float, V: np.ndarray, noise: np.ndarray, rig: Any, M: np.ndarray,
    dx: np.ndarray,
) -> None:  # fmt: skip
    Q, h, G = np.empty(3), np.empty(3), np.empty(3)
    body.mass_terms(x, rig, rig.weight_kg if t >= rig.weight_at_s else 0.0, M, h, G)
    front_V, back_V = effects.at_motors(V[0], V[1], rig)
    share = math.sqrt(rig.mismatch)
    front = share * effects.static_thrust(front_V, rig)
    back = effects.static_thrust(back_V, rig) / share
    dx[6] = dx[7] = 0.0
    if rig.lag_s > 0.0:
        dx[6], dx[7] = (front - x[6]) / rig.lag_s, (back - x[7]) / rig.lag_s
        front, back = x[6], x[7]
    front, back = effects.thrusts(x, front, back, front_V, back_V, rig)
    body.thrust_torques(x, front, back, rig, Q)
    effects.add_torques(x, t, front_V, back_V, rig, Q)
    W = body.inverse(M)
    for i in range(3):
        dx[i], dx[3 + i] = x[3 + i], 0.0
        for j in range(3):
            dx[3 + i] += W[i, j] * (Q[j] + noise[j] - h[j] - G[j])


@kernel
def step(
    x: np.ndarray, seen: np.ndarray, t: float, dt: float, V: np.ndarray, noise: np.ndarray, rig: Any
) -> None:
    """Advance state and encoder shafts by ``dt``."""
    M, k, before, y = np.empty((3, 3)), np.empty((4, 8)), x.copy(), x.copy()
    for stage, share in enumerate((0.0, 0.5, 0.5, 1.0)):
        for i in range(8):
            y[i] = x[i] + (share * dt * k[stage - 1, i] if stage else 0.0)
        _derivative(y, t + share * dt, V, noise, rig, M, k[stage])
    for i in range(8):
        x[i] += dt / 6 * (k[0, i] + 2 * k[1, i] + 2 * k[2, i] + k[3, i])
    if max(rig.coulomb[0], rig.coulomb[1], rig.coulomb[2]) > 0.0:
        effects.dry_friction(x, before, dt, body.inverse(M), rig)
    effects.follow(seen, x, rig)


@kernel
def _fly(
    rig: Any, T: float, substeps: int, variant: tuple[bool, bool, bool], reference: np.ndarray,
    extra: np.ndarray, noise: np.ndarray, lead: int, x: np.ndarray, I: np.ndarray, V_0: np.ndarray,
) -> tuple[Any, ...]:  # fmt: skip
    rounds, half_count, integrals_first = variant
    n, dt = len(reference), T / substeps
    late = round(rig.delay_s / dt)
    V, command, integral = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    reading, state, shafts = np.zeros((n, 3)), np.zeros((n, 8)), np.zeros((n, 3))
    x, I, seen = x.copy(), I.copy(), x[:3].copy()
    y, r, e, s_1, s_2 = np.zeros(3), np.zeros(3), np.zeros(8), np.zeros(3), np.zeros(3)
    s = 2 / T
    a_0 = s * s + 2 * DAMPING * CUTOFF * s + CUTOFF**2
    b_0 = CUTOFF**2 * s / a_0
    a_1, a_2 = 2 * (CUTOFF**2 - s * s) / a_0, (s * s - 2 * DAMPING * CUTOFF * s + CUTOFF**2) / a_0
    for k in range(n):
        for i in range(3):
            count = (seen[i] * rig.scale[i] + rig.offset_rad[i]) / STEP_RAD[i]
            reading[k, i] = math.floor(count + (0.5 if rounds else 0.0)) * STEP_RAD[i]
            y[i] = reading[k, i] + (0.5 * STEP_RAD[i] if half_count else 0.0)
            if k == 0:
                r[i], s_1[i], s_2[i] = y[i], -b_0 * y[i], -b_0 * y[i]
            rate = b_0 * y[i] + s_1[i]
            s_1[i], s_2[i] = s_2[i] - a_1 * rate, -b_0 * y[i] - a_2 * rate
            most = REFERENCE_RATE * T
            r[i] += min(max(reference[k, i] - r[i], -most), most)
            e[i], e[3 + i] = r[i] - y[i], -rate
        state[k], shafts[k], integral[k] = x, seen, I
        if integrals_first:
            _integrate(I, e, T)
        e[6], e[7] = I[0], I[1]
        for m in range(2):
            command[k, m] = rig.V_o + extra[k, m]
            for i in range(8):
                command[k, m] += GAINS[m, i] * e[i]
            V[k, m] = min(max(command[k, m], -V_MAX), V_MAX)
        if not integrals_first:
            _integrate(I, e, T)
        for j in range(k * substeps, (k + 1) * substeps):
            sent = (j - late) // substeps
            step(x, seen, j * dt - lead * T, dt, V[sent] if sent >= 0 else V_0, noise[j], rig)
        if not (abs(x[0]) < LEFT[0] and abs(x[1]) < LEFT[1] and abs(x[2]) < LEFT[2]):
            return False, V, command, reading, state, shafts, integral
    return True, V, command, reading, state, shafts, integral


@kernel
def _integrate(I: np.ndarray, e: np.ndarray, T: float) -> None:
    for j in range(2):
        most = INTEGRAL_V / abs(GAINS[0, 6 + j])
        I[j] = min(max(I[j] + T * e[2 * j], -most), most)


@kernel
def _predict(
    starts: np.ndarray, ahead: int, T: float, substeps: int, rig: Any, lead: int, V: np.ndarray,
    V_0: np.ndarray, state: np.ndarray, shafts: np.ndarray,
) -> np.ndarray:  # fmt: skip
    dt, out, noise = T / substeps, np.empty((len(starts), 3)), np.zeros(3)
    late = round(rig.delay_s / dt)
    for n, start in enumerate(starts):
        x, seen = state[start].copy(), shafts[start].copy()
        for j in range(start * substeps, (start + ahead) * substeps):
            sent = (j - late) // substeps
            step(x, seen, j * dt - lead * T, dt, V[sent] if sent >= 0 else V_0, noise, rig)
        for i in range(3):
            out[n, i] = seen[i] * rig.scale[i] + rig.offset_rad[i]
    return out


@kernel
def _correlated(white: np.ndarray, decay: float) -> np.ndarray:
    out = white.copy()
    for j in range(1, len(white)):
        out[j] = decay * out[j - 1] + math.sqrt(1 - decay * decay) * white[j]
    return out


def random_torques(rng: np.random.Generator, steps: int, dt: float, tau_c: float) -> np.ndarray:
    """Random torques (steps, 3) in N·m, correlated over ``tau_c`` s."""
    white = rng.standard_normal((steps, 3)) * NOISE_NM / math.sqrt(tau_c)
    return np.asarray(_correlated(white, math.exp(-dt / tau_c)))


def fly(loop: Loop, task: Task, rig: Any) -> Log | None:
    """The flight from its trimmed state; None if it leaves the angles `LEFT`."""
    T, n = 1 / loop.rate_hz, int(SETTLE_S * loop.rate_hz)
    variant = (loop.rounds, loop.half_count, loop.integrals_first)
    steady = rig.copy()
    steady["periodic_Nm"], steady["weight_at_s"] = 0.0, np.inf
    V_0, zeros = np.full(2, rig["V_o"]), np.zeros((n, 3))
    flown, V, _, _, state, _, integral = _fly(
        steady, T, loop.substeps, variant, zeros, np.zeros((n, 2)),
        np.zeros((n * loop.substeps, 3)), 0, np.zeros(8), np.zeros(2), V_0,
    )  # fmt: skip
    if not flown:
        return None
    last = slice(-int(AVERAGE_S * loop.rate_hz), None)
    x, I, V_0 = (a[last].mean(axis=0) for a in (state, integral, V))
    x[3:6] = 0.0
    flown, *arrays = _fly(
        rig, T, loop.substeps, variant, task.reference, task.extra, task.noise, task.lead, x, I, V_0
    )
    return Log(V_0, *arrays) if flown else None


def predicted(
    loop: Loop, task: Task, log: Log, rig: Any, state: np.ndarray, shafts: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Samples k, a second apart, and the angles (n, 3) without noise and quantisation at k + 1 s.

    ``state``, ``shafts``: where each prediction starts. The logged voltages are applied.
    """
    ahead, lead = loop.rate_hz, task.lead
    starts = np.arange(lead, len(log.voltage) - ahead, ahead)
    angles = _predict(starts, ahead, 1 / loop.rate_hz, loop.substeps, rig, lead, log.voltage,
                      log.before_V, state, shafts)  # fmt: skip
    return starts, angles
