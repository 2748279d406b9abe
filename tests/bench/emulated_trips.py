"""Trips emulated rigs with random parameters in flight, by `control_loop.loop.fly`.

The emulated plant shares no code with the model that `simulated_trips` uses, and its angles here
are the true ones. It has the laboratory rig's stops: roll +36°, pitch ±32°.
"""

from __future__ import annotations

import math
from typing import Any
from unittest.mock import patch

import numpy as np
from heli3dof_drivers.emulator.plant import Truth
from heli3dof_drivers.mock import MockRig

from heli3dof.experiment.control_loop import ramp_down
from heli3dof.experiment.control_loop.loop import fly
from heli3dof.experiment.plan import step_plan
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command, Sample
from heli3dof.rig.profile import Profile, default_profile
from tests.bench.simulated_trips import CLEAR, FALL_S, LAG_S, REST, SPREAD, Fall, Situation
from tests.experiment.safety_monitors.periods import Judging
from tests.experiment.safety_monitors.test_false_alarms import Nowhere

LATEST_S = 4.0
"""s, duration of the plans: a flight with a wrong encoder sign leaves the envelope earlier"""


class WithTruth:
    """An emulated rig that keeps its true motion, one entry for each period."""

    def __init__(self, rig: MockRig) -> None:
        self._rig = rig
        self.truth: list[Truth] = [rig.truth]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._rig, name)

    def exchange(self, command: Command, due_s: float) -> Sample:
        sample = self._rig.exchange(command, due_s)
        self.truth.append(self._rig.truth)
        return sample


def tripped(situation: Situation, seed: int, band: float) -> Fall | None:
    """Returns the motion after one trip, or None if the arm was on the table at the trip.

    ``band`` replaces `ramp_down.HOVER_BAND`: with an infinite one every voltage ramps to zero, with
    a negative one zero comes at once.
    """
    profile = _steep(default_profile().with_controller())
    rng = np.random.default_rng([seed, *situation.name.encode()])
    url = f"mock:?speed=max&seed={seed}&spread={SPREAD}&hide=motor.lag:{LAG_S * rng.uniform():.4f}"
    url += "&start=level" if situation.level else ""
    url += "&fault=reversed.roll@0" if situation.sign[0] < 0 else ""
    rig = WithTruth(open_driver(url, profile))
    dt = profile.dt
    begins = round(situation.settle_s / dt)
    ends = begins + max(1, round(rng.uniform(*situation.moment_s) / dt))
    plan = step_plan((situation.roll_deg, None, situation.yaw_deg), settle_s=0, duration_s=LATEST_S)
    signals = plan.render(dt, seed)
    if situation.volts is not None:
        # 10 v_max, so that its sum with the controller's voltage is beyond the limit.
        signals.extra[begins:] = np.multiply(situation.volts, 10 * profile.motor.v_max)
    with patch.object(ramp_down, "HOVER_BAND", band):
        flown = fly(
            rig, profile, signals, Nowhere(),
            monitors=[Judging(lambda now: "tripped for the bench" if now.k >= ends else None)],
        )  # fmt: skip
    for _ in range(round(FALL_S / dt)):
        rig.exchange(Command(0, 0.0, 0.0), 0.0)
    after = rig.truth[flown.periods :]
    roll = [truth.angle[0] for truth in after]
    if roll[0] <= REST + CLEAR:
        return None
    return Fall(
        math.degrees(max(roll) - roll[0]),
        math.degrees(-min(truth.rate[0] for truth in after)),
        math.degrees(max(abs(truth.angle[1]) for truth in after)),
    )


def _steep(profile: Profile) -> Profile:
    """Returns the profile without slew limit: in these flights the voltage jumps to its limit."""
    limits = profile.limits.model_copy(update={"slew_max_V_per_s": 1e9})
    return profile.model_copy(update={"limits": limits})
