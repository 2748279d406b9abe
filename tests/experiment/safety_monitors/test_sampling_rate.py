"""A device with another sampling rate than the profile's ends the flight."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.errors import SafetyTrip
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.experiment.safety_monitors.sampling_rate import SamplingRate
from tests.experiment.safety_monitors.periods import DT, PROFILE, period

PLAN = load_plan("steps")


@pytest.mark.parametrize("rate_hz", [100, 400, 1000])
def test_a_device_with_another_rate_is_reported_with_its_rate(rate_hz: int) -> None:
    flight = fly_plan(PLAN, device=f"mock:?speed=max&rate_hz={rate_hz}")
    with pytest.raises(SafetyTrip, match=f"a sample every {1e3 / rate_hz:g} ms") as caught:
        flight.raise_if_cut_short()
    assert caught.value.fix == f"loop.rate_hz = {rate_hz} in the profile"


def test_periods_that_the_loop_counts_as_skipped_are_no_other_rate() -> None:
    monitor = SamplingRate(PROFILE)
    assert all(monitor(period(5 * k, t=5 * k * DT, skipped=4)) is None for k in range(1000))


def test_jitter_and_losses_are_no_other_rate() -> None:
    rng = np.random.default_rng(0)
    taken = np.flatnonzero(rng.random(10_000) < 0.6) * DT
    jitter = rng.normal(0.0, 0.1 * DT, len(taken))
    monitor = SamplingRate(PROFILE)
    times = enumerate((taken + jitter).tolist())
    assert not any(monitor(period(k, t=t)) for k, t in times)


def test_a_stopped_clock_is_left_to_the_other_monitors() -> None:
    monitor = SamplingRate(PROFILE)
    assert not any(monitor(period(k, t=0.0)) for k in range(100))
