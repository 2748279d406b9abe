"""A count that wandered and is constant in the ramp is reported; a held axis is not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import log

import numpy as np
import pytest

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.safety_monitors.silent_encoder import FALSE_ALARM, SilentEncoder
from tests.experiment.safety_monitors.periods import DT, LEVEL, PROFILE, period

AIR_S, RAMP_S = 20.0, 3.0


def flown(yaw: Callable[[float], int]) -> Iterator[Period]:
    for k in range(round((AIR_S + RAMP_S) / DT)):
        t = k * DT
        now = period(k, counts=(LEVEL, 0, yaw(t)))
        yield now._replace(ramping_down=t >= AIR_S)


def reported(yaw: Callable[[float], int]) -> list[str]:
    monitor = SilentEncoder(PROFILE)
    return [report for now in flown(yaw) if (report := monitor(now)) is not None]


def wandering(seed: int, until_s: float) -> Callable[[float], int]:
    """A count that steps to and fro within two, at random instants 0.2 s apart on average."""
    rng = np.random.default_rng(seed)
    steps = np.cumsum(rng.exponential(0.2, 1000))
    steps = steps[steps < until_s]
    return lambda t: int(abs((np.searchsorted(steps, t) % 4) - 2))


def test_a_count_that_wandered_and_is_constant_in_the_ramp_is_reported() -> None:
    report = reported(wandering(1, until_s=18.0))
    assert report
    assert "the yaw encoder's count stood at" in report[0]


@pytest.mark.parametrize("seed", range(5))
def test_a_count_that_goes_on_wandering_is_not_reported(seed: int) -> None:
    assert reported(wandering(seed, until_s=1e9)) == []


def test_an_axis_held_by_dry_friction_is_not_reported() -> None:
    assert reported(lambda t: min(400, round(40 * t)) if t < 15 else 400) == []


def test_no_report_before_the_ramp() -> None:
    monitor = SilentEncoder(PROFILE)
    silent = wandering(1, until_s=8.0)
    for k in range(round(AIR_S / DT)):
        assert monitor(period(k, counts=(LEVEL, 0, silent(k * DT)))) is None


def test_random_standstills_rarely_exceed_the_bound() -> None:
    """Of exponentially distributed standstills at most a share ε exceeds the bound."""
    rng = np.random.default_rng(7)
    n, runs = 40, 20_000
    stood = rng.exponential(1.0, (runs, n + 1))
    bound = stood[:, :n].max(axis=1) * (1 + log(1 / FALSE_ALARM) / log(n))
    assert np.mean(stood[:, n] > bound) <= FALSE_ALARM
