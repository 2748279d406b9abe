"""Rigs that the diagnosis was not made on: drawn bodies, motors, encoders, controllers and logs.

A rig is drawn from a seed. Its body, rotors and noise are the emulated rig's
(`heli3dof_drivers.emulator`); its controller, loop and log are of this file. Nothing here uses code
that identification or diagnosis fits with. Draws, relative to the paper's rig where a ratio:

====================  ==============================================================================
arms, inertias        L_a, L_h × 0.6–1.5; J_roll, J_pitch × 0.3–3 (log-uniform), all × 0.93–1.07
motors                V_o 1.8–7.5 V; hover torque/J_roll × 0.5–2; v_max = 2.4–3.5 V_o
encoders, rate        2000–8192 counts; 100–1000 Hz
random torques        density in rad/s²/√Hz × 0.5–1.5; correlated over 0.01, 0.2 or 1 s
vibration             in a third of the rigs: a lightly damped mode at 6–15 Hz
controller            LQR of drawn weights; also rounds to half a count, one period late, or with
                      the integrals advanced before the voltage (a quarter each)
log                   with or without the extra voltage; voltage before or after the limiter; time
                      stamps that come in bursts
profile               a third without a controller: the log has no references then
====================  ==============================================================================
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import solve_continuous_are
from scipy.signal import bilinear

from heli3dof.experiment.plan import Plan, Signals
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import Profile, default_profile, profile_from_dict

PAPER = default_profile()
CONTROLLERS = ("exact", "half a count", "one period late", "integrals first")
RATES_HZ = (100.0, 200.0, 250.0, 500.0, 1000.0)
COUNTS = (2000, 2048, 4096, 5000, 8192)
NOISE_S = (0.01, 0.2, 1.0)
INTEGRAL_V = 7.5 / 7.456
"""Limit of an integral's contribution, as a share of V_o"""


@dataclass(frozen=True)
class OtherRig:
    """A drawn rig, its controller and its log."""

    seed: int
    profile: Profile
    options: str
    """Options of the emulated rig that are not effects"""
    controller: str
    """One of `CONTROLLERS`"""
    known: bool
    """The profile of the log has the controller"""
    logs_extra: bool
    before_limiter: bool
    """The log's voltages are those before the limiter"""
    burst: int
    """Samples that the host receives together; 1: each when it was taken"""

    def url(self, hide: str = "") -> str:
        return f"mock:?speed=max&start=level&{self.options}" + (f"&hide={hide}" if hide else "")

    @property
    def log_profile(self) -> Profile:
        """The profile that the diagnosis gets."""
        return self.profile if self.known else self.profile.model_copy(update={"controller": None})


def ratio(rng: np.random.Generator, low: float, high: float) -> float:
    """A log-uniform draw."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def draw_rig(seed: int) -> OtherRig:
    """The rig of a seed."""
    rng = np.random.default_rng([20_261_123, seed])
    L_a = PAPER.geometry.L_a * ratio(rng, 0.6, 1.5)
    L_h = PAPER.geometry.L_h * ratio(rng, 0.6, 1.5)
    L_w = PAPER.geometry.L_w
    J_roll, J_pitch, _ = PAPER.mass_inertias
    J_pitch *= ratio(rng, 0.3, 3.0)
    m = J_pitch / (2 * L_h**2)
    arm = 2 * m * L_a**2
    J_roll = max(J_roll * ratio(rng, 0.3, 3.0), 1.2 * arm)
    V_o = float(rng.uniform(1.8, 7.5))
    hover = PAPER.trim_torque / PAPER.mass_inertias[0] * ratio(rng, 0.5, 2.0)
    K_f = hover * J_roll / (2 * L_a * V_o)
    data: dict[str, Any] = {
        "name": f"other rig {seed}",
        "geometry": {"L_w": L_w, "L_a": L_a, "L_h": L_h},
        "mass": {"m_w": (J_roll - arm) / L_w**2, "m_f": m, "m_b": m},
        "motor": {"K_f": K_f, "V_o": V_o, "v_max": V_o * float(rng.uniform(2.4, 3.5))},
        "encoder": {axis: int(rng.choice(COUNTS)) for axis in ("roll", "pitch", "yaw")},
        "loop": {"rate_hz": float(rng.choice(RATES_HZ))},
    }
    bare = profile_from_dict(data)
    data["controller"] = {"K": lqr(bare, rng).tolist(), "integrator_clamp_V": INTEGRAL_V * V_o}
    return OtherRig(
        seed=seed,
        profile=profile_from_dict(data),
        options=noise_options(bare, rng),
        controller=str(rng.choice(CONTROLLERS)),
        known=bool(rng.random() > 1 / 3),
        logs_extra=bool(rng.random() > 0.25),
        before_limiter=bool(rng.random() < 0.25),
        burst=int(rng.choice([1, 1, 2, 5])),
    )


def noise_options(profile: Profile, rng: np.random.Generator) -> str:
    """Random torques of a drawn density, and the spread of the rig about its profile."""
    scale = math.sqrt(
        profile.inertias[0] / PAPER.inertias[0] * profile.inertias[1] / PAPER.inertias[1]
    )
    options = (
        f"spread=0.07&seed={int(rng.integers(2**31))}&noise={scale * ratio(rng, 0.5, 1.5):.4g}"
        f"&noise_s={rng.choice(NOISE_S):g}"
    )
    if rng.random() < 1 / 3:
        options += f"&vibration_hz={ratio(rng, 6.0, 15.0):.3g}"
    return options


def lqr(profile: Profile, rng: np.random.Generator) -> np.ndarray:
    """(2, 8) gain for the errors r, p, ψ, the rates, ∫r and ∫ψ; the weights are drawn.

    Linear model at hover: r̈ = L_a K_f (v_f + v_b)/J_r, p̈ = L_h K_f (v_f − v_b)/J_p,
    ψ̈ = −2 L_a K_f V_o p/J_ψ.
    """
    g, u = profile.geometry, profile.motor
    J_r, J_p, J_y = profile.inertias
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    A[0:3, 3:6] = np.eye(3)
    A[5, 1] = -2 * g.L_a * u.K_f * u.V_o / J_y
    A[6, 0] = A[7, 2] = 1.0
    B[3] = g.L_a * u.K_f / J_r
    B[4] = np.array([1.0, -1.0]) * g.L_h * u.K_f / J_p
    # Largest angle in rad, rate in rad/s, integral in rad·s; voltage as a share of V_o.
    most = np.array([0.2, 0.25, 0.35, 0.6, 1.2, 1.0, 0.4, 0.7])
    most *= np.exp(rng.uniform(math.log(0.6), math.log(1.6), 8))
    volts = 0.5 * u.V_o * ratio(rng, 0.6, 1.6)
    Q, R = np.diag(most**-2.0), np.eye(2) / volts**2
    return np.asarray(np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R)))


def signals_for(plan: Plan, rig: OtherRig) -> Signals:
    """The plan's signals, its extra voltages scaled to the paper rig's accelerations."""
    signals = plan.render(rig.profile.dt, rig.seed)
    common = _authority(PAPER, 0) / _authority(rig.profile, 0)
    difference = _authority(PAPER, 1) / _authority(rig.profile, 1)
    mean = 0.5 * (signals.extra[:, 0] + signals.extra[:, 1]) * common
    half = 0.5 * (signals.extra[:, 0] - signals.extra[:, 1]) * difference
    extra = np.column_stack([mean + half, mean - half])
    return Signals(signals.t, signals.reference, extra, None)


def _authority(p: Profile, axis: int) -> float:
    """rad/s² per V on roll (0) or pitch (1)."""
    arm = (p.geometry.L_a, p.geometry.L_h)[axis]
    return float(arm * p.motor.K_f / p.inertias[axis])


class Loop:
    """The controller, written independently of `heli3dof.model.control`."""

    def __init__(self, rig: OtherRig) -> None:
        p = rig.profile
        spec = p.with_controller().controller
        assert spec is not None
        self.K, self.dt, self.V_o, self.v_max = spec.K_g, p.dt, p.motor.V_o, p.motor.v_max
        self.variant, self.clamp = rig.controller, spec.integrator_clamp_V
        self.half = 0.5 * np.abs(p.encoder.rad_per_count) * (rig.controller == "half a count")
        w, z = 2 * math.pi * spec.derivative_cutoff_hz, spec.derivative_damping
        self.b, self.a = bilinear([w * w, 0.0], [1.0, 2 * z * w, w * w], fs=1 / p.dt)
        self.step_rad = math.radians(spec.reference_rate_limit_deg_per_s) * p.dt
        self.y = np.zeros((3, 3))
        self.rate = np.zeros((2, 3))
        self.limited, self.integral = np.zeros(3), np.zeros(2)

    def __call__(self, angle: np.ndarray, reference: np.ndarray, extra: np.ndarray) -> np.ndarray:
        """(2,) V before the limiter."""
        angle = angle + self.half
        self.limited += np.clip(reference - self.limited, -self.step_rad, self.step_rad)
        self.y = np.vstack([angle, self.y[:2]])
        rate = self.b @ self.y - self.a[1:] @ self.rate
        self.rate = np.vstack([rate, self.rate[:1]])
        error = self.limited - angle
        if self.variant == "integrals first":
            self._integrate(error)
        parts = self.K[:, 6:] * self.integral
        volts = self.K[:, :3] @ error - self.K[:, 3:6] @ rate
        volts += np.clip(parts, -self.clamp, self.clamp).sum(axis=1)
        if self.variant != "integrals first":
            self._integrate(error)
        return np.asarray(self.V_o + volts + extra)

    def _integrate(self, error: np.ndarray) -> None:
        self.integral += self.dt * error[[0, 2]]
        most = self.clamp / np.abs(self.K[:, 6:]).min(axis=0)
        self.integral = np.clip(self.integral, -most, most)


def fly_rig(rig: OtherRig, plan: Plan, hide: str = "") -> Recording | str:
    """The log of a flight, or why it was not flown to its end."""
    p = rig.profile
    signals, loop = signals_for(plan, rig), Loop(rig)
    device: Any = open_driver(rig.url(hide), p)
    q, rest = p.encoder.rad_per_count, p.encoder.rest_rad
    n = len(signals.t)
    t, angle, asked = np.empty(n), np.empty((n, 3)), np.empty((n, 2))
    sample = device.arm()
    start = sample.device_time_s
    late = np.full(2, p.motor.V_o)
    for k in range(n):
        t[k] = sample.device_time_s - start
        angle[k] = rest + np.array(sample.counts) * q
        if abs(angle[k, 0]) > 0.5 or abs(angle[k, 1]) > 0.55 or abs(angle[k, 2]) > 6:
            device.close()
            return f"out of bounds at {t[k]:.1f} s: {np.degrees(angle[k]).round(1).tolist()}°"
        volts = loop(angle[k], signals.reference[k], signals.extra[k])
        if rig.controller == "one period late":
            volts, late = late, volts
        asked[k] = volts
        sent = np.clip(volts, -p.motor.v_max, p.motor.v_max)
        sample = device.exchange(Command(k + 1, float(sent[0]), float(sent[1])), 0.0)
    device.close()
    return _log(rig, signals, t, angle, asked)


def _log(
    rig: OtherRig, signals: Signals, t: np.ndarray, angle: np.ndarray, asked: np.ndarray
) -> Recording:
    v_max = rig.profile.motor.v_max
    if rig.burst > 1:
        # Time stamps of the arrival: those of one burst lie close together.
        arrival = np.repeat(t[rig.burst - 1 :: rig.burst], rig.burst)[: len(t)]
        within = np.arange(len(arrival)) % rig.burst
        t = arrival + 1e-5 * within
    n = len(t)
    return recording_of_arrays(
        t,
        asked[:n] if rig.before_limiter else np.clip(asked[:n], -v_max, v_max),
        angle[:n],
        rig.log_profile,
        reference=signals.reference[:n] if rig.known else None,
        voltage_cmd=asked[:n] if rig.known else None,
        voltage_extra=signals.extra[:n] if rig.logs_extra else None,
        meta={"name": "flight", "source": "import"},
    )
