"""A loop that is late for half a second in one, and a line that loses in a row."""

from __future__ import annotations

from heli3dof.experiment.safety_monitors import Late, Lost
from heli3dof.rig.trip import Trip
from tests.experiment.safety_monitors.periods import DT, PROFILE, period


def test_half_of_the_last_second_late_ends_the_flight_and_less_does_not() -> None:
    watch = Late(PROFILE)
    assert all(watch(period(k, lateness=0.011)) is None for k in range(250))
    said = watch(period(250, lateness=0.011))
    assert said is not None
    assert "251 of the last 500 periods came more than 10 ms after their time" in said


def test_lateness_is_forgotten_after_a_second() -> None:
    watch = Late(PROFILE)
    for k in range(20_000):
        late = 0.02 if k % 5 == 0 else 0.001
        assert watch(period(k, lateness=late)) is None


def test_the_periods_that_a_late_sample_was_too_late_for_count_with_it() -> None:
    watch = Late(PROFILE)
    assert watch(period(0, lateness=0.4, missed=200)) is None
    assert watch(period(201, lateness=0.12, missed=60)) is not None


def test_samples_that_are_skipped_but_hardly_late_are_no_lateness() -> None:
    watch = Late(PROFILE)
    assert all(watch(period(k, lateness=0.004, missed=1)) is None for k in range(0, 4000, 2))


def test_a_gap_without_samples_longer_than_the_limit_is_a_line_that_loses_them() -> None:
    assert Lost(PROFILE)(period(26, missed=25)) is None
    said = Lost(PROFILE)(period(27, missed=26))
    assert said is not None
    assert "no sample came for 27 periods (54 ms)" in said


def test_a_gap_that_the_device_made_is_said_to_be_its_own() -> None:
    assert Lost(PROFILE)(period(26, missed=25, left_out=25)) is None
    said = Lost(PROFILE)(period(27, missed=26, left_out=26))
    assert said is not None
    assert "no sample came for 27 periods (54 ms): the device itself was held up" in said


def test_what_the_device_left_out_is_no_lateness_of_the_hosts() -> None:
    watch = Late(PROFILE)
    rows = [period(k, lateness=0.011, missed=4, left_out=4) for k in range(250)]
    assert all(watch(row) is None for row in rows)


def test_a_gap_that_the_host_made_is_not_the_lines() -> None:
    assert Lost(PROFILE)(period(300, missed=299, lateness=299 * DT)) is None


def test_commands_that_are_not_echoed_for_longer_than_the_limit_are_lost() -> None:
    watch = Lost(PROFILE)
    for k in range(10):
        assert watch(period(k)) is None
    for k in range(10, 35):
        assert watch(period(k, sequence=9)) is None
    said = watch(period(35, sequence=9))
    assert said is not None
    assert "none of the last 26 commands (52 ms)" in said


def test_a_line_that_loses_nine_commands_of_ten_still_carries_some() -> None:
    watch = Lost(PROFILE)
    assert all(watch(period(k, sequence=k - k % 10)) is None for k in range(5000))


def test_a_line_that_takes_25_ms_is_not_explained_as_a_busy_processor() -> None:
    watch = Late(PROFILE)
    rows = (period(k, lateness=0.025, missed=12, echo_s=0.025) for k in range(0, 2000, 13))
    said = next(filter(None, map(watch, rows)))
    assert "every command took 25.0 ms or more (12 periods) to be echoed" in said
    assert isinstance(said, Trip)
    assert "the line or the device is slow" in said.cause
    assert "latency timer" in said.fix


def test_a_host_that_is_held_up_again_and_again_still_has_quick_periods() -> None:
    watch = Late(PROFILE)
    rows = []
    for k in range(0, 2000, 20):
        rows.append(period(k, lateness=0.02, missed=10, echo_s=0.022))
        rows.extend(period(k + j, echo_s=DT) for j in range(1, 5))
    said = next(filter(None, map(watch, rows)))
    assert isinstance(said, Trip)
    assert "another program takes the processor" in said.cause
