"""A motor at its limit for two seconds; a take-off that saturates for one is none of it."""

from __future__ import annotations

import pytest

from heli3dof.experiment.safety_monitors.saturation import Saturation
from heli3dof.rig.interface import Flags
from tests.experiment.safety_monitors.periods import DT, PROFILE, period


def spoke_at(commands: dict[int, tuple[float, float]] | None = None, **changed) -> float | None:
    monitor = Saturation(PROFILE)
    for k in range(2000):
        command = (30.0, 5.0) if commands is None else commands.get(k, (5.0, 5.0))
        said = monitor(period(k, command=command, **changed))
        if said is not None:
            assert "front motor was at its limit of 24 V for 2 s" in said
            return k * DT
    return None


def test_two_seconds_at_the_limit_end_the_flight() -> None:
    assert spoke_at() == pytest.approx(2.0 + DT)


def test_a_device_that_clips_to_a_lower_limit_of_its_own_says_so_by_its_flag() -> None:
    late = dict.fromkeys(range(2000), (5.0, 5.0))
    assert spoke_at(late) is None
    assert spoke_at(late, flags=Flags.ENABLED | Flags.SATURATED) == pytest.approx(2.0 + DT)


def test_a_short_break_does_not_start_the_clock_anew_and_a_long_one_does() -> None:
    chattering = {k: (-30.0, 5.0) for k in range(2000) if k % 50 < 40}
    assert spoke_at(chattering) is not None
    pausing = {k: (-30.0, 5.0) for k in range(2000) if k % 500 < 380}
    assert spoke_at(pausing) is None
