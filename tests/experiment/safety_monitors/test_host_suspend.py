"""A computer that slept is detected, and the flight ends without a ramp."""

from __future__ import annotations

import pytest

from heli3dof.experiment.safety_monitors import host_suspend
from heli3dof.experiment.safety_monitors.host_suspend import HostSuspend
from tests.experiment.safety_monitors.periods import PROFILE, period


def test_a_sleep_ends_the_flight_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    ahead = [1000.0]
    monkeypatch.setattr(host_suspend, "ahead_s", lambda: ahead[0])
    monitor = HostSuspend(PROFILE)
    assert (monitor(period(0)), monitor.stop_without_ramp()) == (None, None)
    ahead[0] += 3.25
    assert monitor(period(1)) == "the computer slept for 3.2 s in mid-flight"
    assert monitor.stop_without_ramp() == "stopped at once, since the computer slept"


def test_a_computer_that_stays_awake_is_not_reported() -> None:
    monitor = HostSuspend(PROFILE)
    assert all(monitor(period(k)) is None for k in range(20_000))


def test_without_the_clock_no_sleep_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delattr(host_suspend.time, "CLOCK_BOOTTIME")
    assert host_suspend.ahead_s() == 0.0
