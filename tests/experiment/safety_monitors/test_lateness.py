"""A loop that is late for half of a second ends the flight."""

from __future__ import annotations

from heli3dof.experiment.safety_monitors.lateness import Lateness
from heli3dof.rig.trip import Trip
from tests.experiment.safety_monitors.periods import DT, PROFILE, period


def test_half_of_the_last_second_late_ends_the_flight_and_less_does_not() -> None:
    monitor = Lateness(PROFILE)
    assert all(monitor(period(k, lateness=0.011)) is None for k in range(250))
    report = monitor(period(250, lateness=0.011))
    assert report is not None
    assert "251 of the last 500 came more than 10 ms after their time" in report


def test_lateness_is_forgotten_after_a_second() -> None:
    monitor = Lateness(PROFILE)
    for k in range(20_000):
        late = 0.02 if k % 5 == 0 else 0.001
        assert monitor(period(k, lateness=late)) is None


def test_periods_missed_before_a_late_sample_count_as_late() -> None:
    monitor = Lateness(PROFILE)
    assert monitor(period(0, lateness=0.4, skipped=200)) is None
    assert monitor(period(201, lateness=0.12, skipped=60)) is not None


def test_skipped_samples_without_lateness_are_not_reported() -> None:
    monitor = Lateness(PROFILE)
    assert all(monitor(period(k, lateness=0.004, skipped=1)) is None for k in range(0, 4000, 2))


def test_samples_left_out_by_the_device_are_no_lateness() -> None:
    monitor = Lateness(PROFILE)
    rows = [period(k, lateness=0.011, skipped=4, device_skipped=4) for k in range(250)]
    assert all(monitor(row) is None for row in rows)


def test_a_line_that_takes_25_ms_is_reported_as_slow() -> None:
    monitor = Lateness(PROFILE)
    rows = (period(k, lateness=0.025, skipped=12, echo_s=0.025) for k in range(0, 2000, 13))
    report = next(filter(None, map(monitor, rows)))
    assert "every command took 25.0 ms or more (12 periods) to be echoed" in report
    assert isinstance(report, Trip)
    assert "the line or the device is slow" in report.cause
    assert "latency timer" in report.fix


def test_a_line_that_becomes_slow_in_flight_is_reported_as_slow() -> None:
    monitor = Lateness(PROFILE)
    assert all(monitor(period(k, echo_s=DT)) is None for k in range(1000))
    assert monitor(period(1014, lateness=0.028, skipped=14, echo_s=0.03)) is None
    rows = (period(k, lateness=0.028, echo_s=0.03) for k in range(1015, 2000))
    report = next(filter(None, map(monitor, rows)))
    assert "every command took 30.0 ms or more (15 periods) to be echoed" in report
    assert isinstance(report, Trip)
    assert "the line or the device is slow" in report.cause


def test_a_device_that_answers_every_command_late_is_reported_as_slow() -> None:
    """It takes 12 periods for each sample, so few samples come before the flight ends."""
    monitor = Lateness(PROFILE)
    assert all(monitor(period(k, echo_s=DT)) is None for k in range(3000))
    slow = (period(k, lateness=0.022, skipped=11, echo_s=0.024) for k in range(3012, 5000, 12))
    report = next(filter(None, map(monitor, slow)))
    assert isinstance(report, Trip)
    assert "the line or the device is slow" in report.cause


def test_a_line_that_delivers_two_samples_at_once_is_reported_as_slow() -> None:
    """The second sample echoes no new command, since the host had no time to send one."""
    monitor = Lateness(PROFILE)
    assert all(monitor(period(k, echo_s=DT)) is None for k in range(1000))
    rows = (period(k, lateness=0.03, echo_s=0.032 * (k % 2)) for k in range(1000, 2000))
    report = next(filter(None, map(monitor, rows)))
    assert isinstance(report, Trip)
    assert "the line or the device is slow" in report.cause


def test_a_busy_host_with_some_quick_periods_is_reported_as_busy() -> None:
    monitor = Lateness(PROFILE)
    rows = []
    for k in range(0, 2000, 20):
        rows.append(period(k, lateness=0.02, skipped=10, echo_s=0.022))
        rows.extend(period(k + j, echo_s=DT) for j in range(1, 5))
    report = next(filter(None, map(monitor, rows)))
    assert isinstance(report, Trip)
    assert "another program takes the processor" in report.cause
