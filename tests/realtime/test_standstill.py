"""Lateness that the machine's own standstills explain, and lateness that they do not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from tests.realtime.standstill import Standstills, late_of_its_own, watched


def test_late_and_missed_periods_are_told_apart_by_when_the_machine_stood_still() -> None:
    dt = 2e-3
    device = dt * np.arange(10.0)
    device[6:] += 3 * dt  # three periods missed before the sixth
    late = np.zeros(10)
    late[3], late[6] = 4e-3, 6e-3
    channels = {"host_time_s": 100 + device + late, "lateness_s": late, "device_time_s": device}
    flight = cast(Any, SimpleNamespace(channels=channels, dt=dt))
    assert late_of_its_own(flight, Standstills()) == (5, 5)
    # By hand: the machine stood still from 100.013 to 100.019, the sixth row's way.
    assert late_of_its_own(flight, Standstills([(100.013, 100.019)])) == (5, 1)


def test_a_watch_that_sees_nothing_ends_with_nothing_or_with_times_that_rise() -> None:
    with watched() as still:
        pass
    assert all(a < b for a, b in still.seen)
