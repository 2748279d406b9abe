"""A motor at its limit for two seconds ends the flight."""

from __future__ import annotations

import pytest

from heli3dof.experiment.safety_monitors.saturation import Saturation
from heli3dof.rig.interface import Flags
from tests.experiment.safety_monitors.periods import DT, PROFILE, period


def reported_at_s(
    commands: dict[int, tuple[float, float]] | None = None, motor: str = "the front", **changed
) -> float | None:
    monitor = Saturation(PROFILE)
    for k in range(2000):
        command = (30.0, 5.0) if commands is None else commands.get(k, (5.0, 5.0))
        report = monitor(period(k, command=command, **changed))
        if report is not None:
            assert f"{motor} motor was at its limit of 24 V for 2 s" in report
            return k * DT
    return None


def test_two_seconds_at_the_limit_end_the_flight() -> None:
    assert reported_at_s() == pytest.approx(2.0 + DT)


def test_the_devices_flag_counts_as_saturation() -> None:
    late = dict.fromkeys(range(2000), (5.0, 5.0))
    assert reported_at_s(late) is None
    flags = Flags.ENABLED | Flags.SATURATED
    assert reported_at_s(late, "a", flags=flags) == pytest.approx(2.0 + DT)


def test_the_motor_that_is_commanded_beyond_its_limit_is_named() -> None:
    back = dict.fromkeys(range(2000), (5.0, 30.0))
    assert reported_at_s(back, "the back") == pytest.approx(2.0 + DT)
    flags = Flags.ENABLED | Flags.SATURATED
    assert reported_at_s(back, "the back", flags=flags) == pytest.approx(2.0 + DT)


def test_only_a_long_break_restarts_the_time() -> None:
    short_breaks = {k: (-30.0, 5.0) for k in range(2000) if k % 50 < 40}
    assert reported_at_s(short_breaks) is not None
    long_breaks = {k: (-30.0, 5.0) for k in range(2000) if k % 500 < 380}
    assert reported_at_s(long_breaks) is None
