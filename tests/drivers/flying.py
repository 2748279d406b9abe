"""A small closed loop with the default controller, for tests of the emulated rig.

It is written from the controller's specification, independent of heli3dof.model.control.controller.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command, Sample
from heli3dof.rig.profile import Profile, default_profile


class ContractController:
    """V = V_o + K_g [errors; −rates; ∫errors] + extra, clipped."""

    def __init__(self, profile: Profile, angle: np.ndarray) -> None:
        spec = profile.with_controller().controller
        assert spec is not None
        self.dt, self.motor, self.K = profile.dt, profile.motor, spec.K_g
        w, z, c = 2 * np.pi * spec.derivative_cutoff_hz, spec.derivative_damping, 2 / profile.dt
        a0 = c * c + 2 * z * w * c + w * w
        self.b = w * w * c / a0
        self.a = ((2 * w * w - 2 * c * c) / a0, (c * c - 2 * z * w * c + w * w) / a0)
        self.y1, self.y2 = angle.copy(), angle.copy()
        self.d1, self.d2 = np.zeros(3), np.zeros(3)
        self.ref = angle.copy()
        self.xi = np.zeros(2)
        self.step_limit = np.radians(spec.reference_rate_limit_deg_per_s) * profile.dt
        self.clamp = spec.integrator_clamp_V

    def __call__(self, y: np.ndarray, reference: np.ndarray, extra: np.ndarray) -> np.ndarray:
        self.ref = self.ref + np.clip(reference - self.ref, -self.step_limit, self.step_limit)
        rate = self.b * (y - self.y2) - self.a[0] * self.d1 - self.a[1] * self.d2
        self.y1, self.y2, self.d1, self.d2 = y, self.y1, rate, self.d1
        e = self.ref - y
        K = self.K
        v = self.motor.V_o + K[:, :3] @ e - K[:, 3:6] @ rate + extra
        for j in range(2):
            v = v + np.clip(K[:, 6 + j] * self.xi[j], -self.clamp, self.clamp)
        self.xi = self.xi + e[[0, 2]] * self.dt
        return np.clip(v, -self.motor.v_max, self.motor.v_max)


@dataclass
class Log:
    """Arrays of a run: t (N,) s; measured angle and true angle (N, 3) rad; voltage (N, 2) V."""

    t: np.ndarray
    angle: np.ndarray
    true: np.ndarray
    voltage: np.ndarray
    samples: list[Sample]


def fly(
    url: str,
    reference: np.ndarray | Callable[[float], np.ndarray],
    extra: np.ndarray | None = None,
    *,
    seconds: float | None = None,
    profile: Profile | None = None,
) -> Log:
    """Run references ((N, 3) rad, or a function of s) on the rig of a URL, in closed loop."""
    profile = profile or default_profile()
    n = len(reference) if isinstance(reference, np.ndarray) else round((seconds or 10) / profile.dt)
    rig = open_driver(url, profile)
    grid, rest = profile.encoder.rad_per_count, profile.encoder.rest_rad
    sample = rig.arm()
    controller = ContractController(profile, rest + np.array(sample.counts) * grid)
    t, angle, true, voltage, samples = [], [], [], [], []
    due = sample.host_time_s
    for k in range(n):
        y = rest + np.array(sample.counts) * grid
        ref = reference[k] if isinstance(reference, np.ndarray) else reference(k * profile.dt)
        v = controller(y, ref, np.zeros(2) if extra is None else extra[k])
        t.append(sample.device_time_s)
        angle.append(y)
        true.append(rig.truth.angle)  # type: ignore[attr-defined]
        voltage.append(v)
        due += profile.dt
        sample = rig.exchange(Command(k + 1, float(v[0]), float(v[1])), due)
        samples.append(sample)
    rig.close()
    return Log(np.array(t), np.array(angle), np.array(true), np.array(voltage), samples)


def fit_percent(y: np.ndarray, model: np.ndarray) -> np.ndarray:
    """100 (1 − ‖y − ŷ‖ / ‖y − mean y‖) per column."""
    return 100 * (
        1 - np.linalg.norm(y - model, axis=0) / np.linalg.norm(y - y.mean(axis=0), axis=0)
    )
