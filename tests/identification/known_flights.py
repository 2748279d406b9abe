"""Flights of the mock rig with known parameters: a plant independent of the estimator's code.

True values are in units of the profile's K_f (`heli3dof.model.physics.rigid_body`), like
estimates.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from heli3dof.experiment.plan import Plan, load_plan, plan_from_dict
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import default_profile
from tests.flown import flown
from tests.profiles import profile

PARAMETERS = {
    "motor.lag.time_constant_s": 0.1,
    "stiffness.pendulum.roll.torque_Nm": 1.0,
    "stiffness.pendulum.pitch.torque_Nm": 0.01,
    "friction.viscous.roll.damping_Nms_per_rad": 0.05,
    "friction.viscous.pitch.damping_Nms_per_rad": 0.01,
    "friction.viscous.yaw.damping_Nms_per_rad": 0.1,
}
HIDDEN = ",".join(f"{name.rpartition('.')[0]}:{value:g}" for name, value in PARAMETERS.items())
TORQUE_NOISE = np.array([0.035, 0.0035, 0.015]) * np.sqrt(2 * 0.01)
"""(3,) N·m/√Hz: the mock's random torques at frequencies below their bandwidth (mock.md)."""


@dataclass(frozen=True, eq=False)
class Flight:
    """A recording, true values by parameter name, and the noise (4,) in the estimator's units."""

    recording: Recording
    truth: dict[str, float]
    noise: np.ndarray


@cache
def fly(
    seed: int,
    plan: str | Plan = "multisine",
    *,
    noise: float = 1.0,
    spread: float = 0.1,
    hide: str = HIDDEN,
    start: str = "rest",
    until_s: float | None = None,
    rate_hz: float = 250.0,
) -> Flight:
    """One flight; the seed determines all noise. ``until_s``: only the first part of the plan."""
    from heli3dof_drivers import mock

    wanted = load_plan(plan) if isinstance(plan, str) else plan
    opened: list[Any] = []

    class Remembered(mock.MockRig):
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            opened.append(self)

    original, mock.MockRig = mock.MockRig, Remembered  # type: ignore[misc]
    try:
        recording = flown(
            wanted,
            until_s,
            device=f"mock:?hide={hide}&seed={seed}&speed=max&noise={noise}&spread={spread}"
            f"&start={start}",
            seed=seed,
            profile=profile(rate_hz=rate_hz),
        )
    finally:
        mock.MockRig = original  # type: ignore[misc]
    body = opened[0].truth.body
    gain = body.K_f / default_profile().motor.K_f * body.gain[0]
    J = np.array([body.J_w + body.I_bb, body.I_aa, body.J_w + body.I_bb + body.I_aa])
    truth = {"T_g": body.T_g / gain}
    truth |= {f"J_{a}": float(j) / gain for a, j in zip(("roll", "pitch", "yaw"), J, strict=True)}
    for name, value in PARAMETERS.items():
        truth[name] = value if name.startswith("motor.") else value / gain
    truth |= {f"bias.torque.{a}.torque_Nm": 0.0 for a in ("pitch", "yaw")}
    return Flight(recording, truth, np.append(noise * TORQUE_NOISE / J, 0.0))


def long_plan(seconds: float = 90.0) -> Plan:
    """The multisine plan stretched to that length."""
    part = (seconds - 10.0) / 4
    targets = ({}, {"roll_deg": 10.0}, {"yaw_deg": 20.0}, {"roll_deg": -5.0, "yaw_deg": 0.0})
    segments: list[dict[str, Any]] = [{"kind": "hold", "duration_s": 10.0}]
    segments += [{"kind": "multisine", "duration_s": part, **t} for t in targets]
    return plan_from_dict({"name": "long", "segment": segments})
