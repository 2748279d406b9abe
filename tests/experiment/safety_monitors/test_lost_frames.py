"""A line that loses samples or commands in a row ends the flight."""

from __future__ import annotations

from heli3dof.experiment.safety_monitors.lost_frames import LostFrames
from tests.experiment.safety_monitors.periods import DT, PROFILE, period


def test_a_gap_longer_than_the_limit_is_a_loss_on_the_line() -> None:
    assert LostFrames(PROFILE)(period(26, skipped=25)) is None
    report = LostFrames(PROFILE)(period(27, skipped=26))
    assert report is not None
    assert "no sample came for 27 periods (54 ms)" in report


def test_a_gap_that_the_device_made_is_attributed_to_it() -> None:
    assert LostFrames(PROFILE)(period(26, skipped=25, device_skipped=25)) is None
    report = LostFrames(PROFILE)(period(27, skipped=26, device_skipped=26))
    assert report is not None
    assert "no sample came for 27 periods (54 ms): the device itself was held up" in report


def test_a_gap_that_the_host_made_is_no_loss() -> None:
    assert LostFrames(PROFILE)(period(300, skipped=299, lateness=299 * DT)) is None


def test_commands_without_an_echo_for_longer_than_the_limit_are_lost() -> None:
    monitor = LostFrames(PROFILE)
    for k in range(10):
        assert monitor(period(k)) is None
    for k in range(10, 35):
        assert monitor(period(k, sequence=9)) is None
    report = monitor(period(35, sequence=9))
    assert report is not None
    assert "none of the last 26 commands (52 ms)" in report


def test_a_line_that_loses_nine_commands_of_ten_is_not_reported() -> None:
    monitor = LostFrames(PROFILE)
    assert all(monitor(period(k, sequence=k - k % 10)) is None for k in range(5000))
