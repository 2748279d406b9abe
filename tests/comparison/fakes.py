"""A small rig and a small model for the tests of comparison and report.

The corrected hover model (errata E3, E4) written a second time with the numbers of Table I,
so that these tests do not depend on ``heli3dof.model``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.model.base import LoopResult, LoopTask
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import ControllerSpec, Profile, default_profile

PER_ROLL = 0.6604 * 0.1188 / 0.9145  # L_a K_f / J_roll, rad/s² per V
PER_PITCH = 0.1188 / (2 * 0.575 * 0.1778)  # K_f / (2 m_f L_h), rad/s² per V
PER_YAW = 1.2304  # rad/s² per rad of pitch


@dataclass(frozen=True)
class FakeHover:
    """Double integrators in roll and pitch, yaw driven by pitch; ideal rates in the loop."""

    name: str = "hover"
    kind: str = "hover"
    thrust: float = 1.0
    bias_V: float = 0.0
    yaw_sign: float = -1.0
    """+1 for the sign as printed in (10), which K_g does not stabilise (E3)."""
    profile = None

    def fly(self, task: LoopTask) -> LoopResult:
        n, K = len(task.reference), task.controller.K_g
        reference = np.nan_to_num(task.reference)
        angle, rate, integral = task.angle0.copy(), np.zeros(3), np.zeros(2)
        angles, volts = np.zeros((n, 3)), np.zeros((n, 2))
        for k in range(n):
            error = reference[k] - angle
            integral += task.dt * error[[0, 2]]
            cmd = task.V_o + K @ np.concatenate([error, -rate, integral]) + task.extra[k]
            volts[k], angles[k] = np.clip(cmd, -task.v_max, task.v_max), angle
            front, back = self.thrust * (volts[k] - task.V_o + self.bias_V)
            acceleration = np.array(
                [
                    PER_ROLL * (front + back),
                    PER_PITCH * (front - back),
                    self.yaw_sign * PER_YAW * angle[1],
                ]
            )
            angle = angle + task.dt * rate + 0.5 * task.dt**2 * acceleration
            rate = rate + task.dt * acceleration
        return LoopResult(task.dt * np.arange(n), angles, volts, volts)

    def loop_poles(self, controller: ControllerSpec, dt: float) -> np.ndarray:
        return np.array([-1.0 + 1.0j, -1.0 - 1.0j, 1.469 if self.yaw_sign > 0 else -0.1])

    def predict(self, recording: Recording, horizon_s: float) -> np.ndarray:
        """Angle and its finite difference, carried forward."""
        h = max(1, round(horizon_s / recording.dt))
        y = recording.angle
        rate = np.zeros_like(y)
        rate[25:] = (y[25:] - y[:-25]) / (25 * recording.dt)
        out = np.full_like(y, np.nan)
        out[h:] = y[:-h] + horizon_s * rate[:-h]
        return out

    def to_dict(self) -> Mapping[str, Any]:
        return {"kind": self.kind, "name": self.name}


@dataclass(frozen=True)
class WrongRate(FakeHover):
    """A model for another control rate, which refuses the recording."""

    name: str = "wrong-rate"

    def fly(self, task: LoopTask) -> LoopResult:
        raise RecordingError("the model was made for 200 Hz, the recording is at 500 Hz")

    def predict(self, recording: Recording, horizon_s: float) -> np.ndarray:
        raise RecordingError("the model was made for 200 Hz, the recording is at 500 Hz")


def flight(
    *,
    roll_deg: float = 10.0,
    yaw_deg: float = 0.0,
    duration_s: float = 10.0,
    start_deg: tuple[float, float, float] = (0.0, 0.0, 0.0),
    truth: FakeHover | None = None,
    profile: Profile | None = None,
    noise_deg: float = 0.0,
    seed: int = 1,
    name: str = "step-10",
) -> Recording:
    """A recorded 10° roll step, flown on a fake rig (the true model unless ``truth`` is given)."""
    profile = profile or default_profile()
    n = round(duration_s * profile.loop.rate_hz) + 1
    reference = np.tile(np.radians([roll_deg, 0.0, yaw_deg]), (n, 1))
    task = LoopTask(
        reference=reference,
        extra=np.zeros((n, 2)),
        angle0=np.radians(start_deg),
        controller=profile.with_controller().controller or ControllerSpec(),
        V_o=profile.motor.V_o,
        v_max=profile.motor.v_max,
        dt=profile.dt,
    )
    result = (truth or FakeHover()).fly(task)
    noise = np.random.default_rng(seed).normal(0, np.radians(noise_deg), result.angle.shape)
    return recording_of_arrays(
        result.t,
        result.voltage,
        result.angle + noise,
        profile,
        reference=reference,
        voltage_cmd=result.voltage_cmd,
        voltage_extra=task.extra,
        meta={"name": name, "plan": f"step --roll {roll_deg:g}", "seed": seed},
    )
