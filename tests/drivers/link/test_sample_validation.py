"""Which samples are believed, by hand and for every number there is."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from heli3dof_drivers.link.frames import NOT_MEASURED, SampleFrame
from heli3dof_drivers.link.link_statistics import LinkStatistics
from heli3dof_drivers.link.sample_validation import Intake
from hypothesis import example, given
from hypothesis import strategies as st

from heli3dof.rig.interface import Flags

U32 = st.integers(0, 2**32 - 1)


def frame(number: int, echo: int, time_us: int = 0, **values: int) -> SampleFrame:
    rest = {
        "roll": 1, "pitch": 2, "yaw": -3, "front_uV": 7_456_000, "back_uV": -1, "front_mA": -250,
        "back_mA": NOT_MEASURED, "delay_us": 300, "flags": 1, "cause": 0, **values,
    }  # fmt: skip
    return SampleFrame(number, echo, time_us, **rest)


def test_a_sample_in_the_ports_units():
    intake = Intake(LinkStatistics())
    armed = intake.arm()
    number = intake.command(41, 0.0)
    assert intake.take(frame(0, armed, 1_000_000), 5.0) is not None
    sample = intake.take(frame(1, number, 1_002_000, flags=33), 5.002)
    assert sample is not None
    assert (sample.sequence, sample.device_time_s, sample.host_time_s) == (41, 1.002, 5.002)
    assert (sample.counts, sample.v_applied) == ((1, 2, -3), (7.456, -1e-6))
    assert sample.current[0] == -0.25
    assert math.isnan(sample.current[1])
    assert sample.flags == Flags.ENABLED | Flags.SATURATED


def test_what_cannot_be_is_rejected_and_what_did_not_come_is_counted():
    statistics = LinkStatistics()
    intake = Intake(statistics)
    before = intake.arm()
    old = intake.command(1, 0.0)
    armed = intake.arm()
    first, second = intake.command(1, 0.0), intake.command(2, 0.0)
    assert intake.take(frame(0, before), 0.0) is None  # an older arming's
    assert intake.take(frame(0, old), 0.0) is None
    assert intake.take(frame(0, armed), 0.0) is not None
    assert intake.take(frame(0, armed), 0.0) is None  # once more
    assert intake.take(frame(4, second), 0.0) is not None
    assert statistics.lost == 3
    assert intake.take(frame(3, second), 0.0) is None  # overtaken
    assert intake.take(frame(5, first), 0.0) is None  # an echo that goes back
    assert intake.take(frame(5, second + 1), 0.0) is None  # never sent
    assert statistics.rejected == 6
    assert statistics.lost == 3


def test_a_gap_in_numbers_is_lost_and_a_jump_of_time_beyond_it_is_left_out():
    statistics = LinkStatistics()
    intake = Intake(statistics)
    armed = intake.arm(2000)
    for number, time_us in [
        (0, 1000), (1, 3000),
        (4, 9000),  # 2 and 3 did not come
        (5, 15_000),  # held up: nothing at 11 and 13 ms
        (8, 27_900),  # 6 and 7 did not come, three were never made, and this one is late
        (9, 29_000),
    ]:  # fmt: skip
        assert intake.take(frame(number, armed, time_us), 0.0) is not None
    assert (statistics.lost, statistics.left_out) == (4, 5)


def test_without_a_stream_no_time_jumps():
    statistics = LinkStatistics()
    intake = Intake(statistics)
    armed = intake.arm()
    for number, time_us in [(0, 1000), (1, 900_000)]:
        assert intake.take(frame(number, armed, time_us), 0.0) is not None
    assert statistics.left_out == 0


@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 1999)), max_size=200)
)
@example([(0, 0, 1999), (0, 0, 0)])
def test_whatever_is_lost_and_left_out_is_counted_as_that(steps: list[tuple[int, int, int]]):
    """Each sample late by anything less than its 2 ms."""
    statistics = LinkStatistics()
    intake = Intake(statistics)
    armed = intake.arm(2000)
    assert intake.take(frame(0, armed), 0.0) is not None
    number = instant = 0
    for lost, left_out, late_us in steps:
        number += 1 + lost
        instant += 1 + lost + left_out
        time_us = instant * 2000 + late_us
        assert intake.take(frame(number, armed, time_us), 0.0) is not None
    assert statistics.lost == sum(lost for lost, _, _ in steps)
    assert statistics.left_out == sum(left_out for _, left_out, _ in steps)


@given(U32, st.lists(st.integers(1, 5), min_size=1, max_size=50))
def test_numbers_may_wrap_wherever_they_do(start: int, steps: list[int]):
    statistics = LinkStatistics()
    intake = Intake(statistics)
    intake.number = start
    armed = intake.arm()
    assert intake.take(frame(start, armed), 0.0) is not None
    number = start
    for sequence, step in enumerate(steps):
        number = (number + step) % 2**32
        sample = intake.take(frame(number, intake.command(sequence, 0.0)), 0.0)
        assert sample is not None
        assert sample.sequence == sequence
        assert intake.heard
    assert statistics.lost == sum(steps) - len(steps)
    assert statistics.rejected == 0


@given(U32, st.lists(st.integers(-800, 2**31 - 1), max_size=20))
def test_the_devices_clock_is_unwrapped(start_us: int, steps: list[int]):
    """Jitter may take it back a little; 35 minutes from one sample to the next are no wrap."""
    intake = Intake(LinkStatistics())
    now = start_us
    for step in [0, *steps]:
        now += step
        sample = intake.sample(frame(0, 0, now % 2**32), 0.0)
        assert sample.device_time_s == pytest.approx(now * 1e-6, abs=1e-9, rel=1e-15)


@given(U32, U32, U32, U32)
def test_only_an_echo_between_the_arming_and_the_last_command_is_believed(
    start: int, echo: int, number: int, sent: int
):
    intake = Intake(LinkStatistics())
    intake.number = start
    armed = intake.arm()
    for k in range(sent % 5):
        intake.command(k, 0.0)
    between = (echo - armed) % 2**32 <= sent % 5
    assert (intake.take(frame(number, echo), 0.0) is not None) == between


@given(
    st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3),
    st.lists(st.tuples(*[st.integers(-(2**30), 2**30)] * 3), max_size=8),
)
def test_counts_that_wrap_at_32_bits_go_on(start, steps):
    intake = Intake(LinkStatistics())
    counts = list(start)
    for step in [(0, 0, 0), *steps]:
        counts = [c + s for c, s in zip(counts, step, strict=True)]
        roll, pitch, yaw = ((c + 2**31) % 2**32 - 2**31 for c in counts)
        sent = replace(frame(0, 0), roll=roll, pitch=pitch, yaw=yaw)
        assert intake.sample(sent, 0.0).counts == tuple(counts)
