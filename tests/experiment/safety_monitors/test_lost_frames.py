"""A line that loses samples or commands in a row ends the flight."""

from __future__ import annotations

from heli3dof.experiment.safety_monitors.lost_frames import LostFrames
from heli3dof.rig.trip import Trip
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


def test_an_echo_of_a_command_that_was_never_sent_is_reported_at_once() -> None:
    monitor = LostFrames(PROFILE)
    assert monitor(period(0)) is None
    report = monitor(period(1, sequence=101))
    assert report is not None
    assert "acknowledged command 101, which was never sent (the last one was 1)" in report


def test_the_echo_of_an_earlier_flight_is_no_error_until_a_command_arrives() -> None:
    monitor = LostFrames(PROFILE)
    assert all(monitor(period(k, sequence=6000)) is None for k in range(10))
    assert all(monitor(period(k)) is None for k in range(10, 100))


def test_a_device_that_repeats_one_sample_is_not_taken_for_a_bad_line() -> None:
    monitor = LostFrames(PROFILE)
    for k in range(10):
        assert monitor(period(k)) is None
    repeated = (period(k, sequence=9, t=9 * DT) for k in range(10, 100))
    report = next(filter(None, map(monitor, repeated)))
    assert "the device's time stayed at 0.018 s" in report
    assert isinstance(report, Trip)
    assert "repeats one sample" in report.cause


def test_a_device_that_acknowledges_nothing_may_also_ignore_the_commands() -> None:
    monitor = LostFrames(PROFILE)
    report = next(filter(None, (monitor(period(k, sequence=0)) for k in range(100))))
    assert "the line loses frames or delays them, or the device ignores commands" in report
    assert "a latency above this time" in report.cause
