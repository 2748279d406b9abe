"""Which samples are accepted, by hand and for every number."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from heli3dof_drivers.link.frames import NOT_MEASURED, SampleFrame
from heli3dof_drivers.link.request_reply import LinkStatistics
from heli3dof_drivers.link.sample_validation import SampleValidator
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


def test_a_sample_is_converted_to_si_units():
    validator = SampleValidator(LinkStatistics())
    armed = validator.arm()
    number = validator.command(41)
    assert validator.accept(frame(0, armed, 1_000_000), 5.0) is not None
    sample = validator.accept(frame(1, number, 1_002_000, flags=33), 5.002)
    assert sample is not None
    assert (sample.sequence, sample.device_time_s, sample.host_time_s) == (41, 1.002, 5.002)
    assert (sample.counts, sample.v_applied) == ((1, 2, -3), (7.456, -1e-6))
    assert sample.current[0] == -0.25
    assert math.isnan(sample.current[1])
    assert sample.flags == Flags.ENABLED | Flags.SATURATED


def test_impossible_samples_are_rejected_and_missing_ones_counted():
    statistics = LinkStatistics()
    validator = SampleValidator(statistics)
    before = validator.arm()
    old = validator.command(1)
    armed = validator.arm()
    first, second = validator.command(1), validator.command(2)
    assert validator.accept(frame(0, before), 0.0) is None  # an older arming's
    assert validator.accept(frame(0, old), 0.0) is None
    assert validator.accept(frame(0, armed), 0.0) is not None
    assert validator.accept(frame(0, armed), 0.0) is None  # repeated
    assert validator.accept(frame(4, second), 0.0) is not None
    assert statistics.lost == 3
    assert validator.accept(frame(3, second), 0.0) is None  # overtaken
    assert validator.accept(frame(5, first), 0.0) is None  # an echo that goes back
    assert validator.accept(frame(5, second + 1), 0.0) is None  # never sent
    assert statistics.rejected == 6
    assert statistics.lost == 3


def test_missing_numbers_are_lost_and_a_further_jump_of_time_is_skipped():
    statistics = LinkStatistics()
    validator = SampleValidator(statistics)
    armed = validator.arm(2000)
    for number, time_us in [
        (0, 1000), (1, 3000),
        (4, 9000),  # 2 and 3 are lost
        (5, 15_000),  # held up: nothing at 11 and 13 ms
        (8, 27_900),  # 6 and 7 are lost, three were skipped, and this one is late
        (9, 29_000),
    ]:  # fmt: skip
        assert validator.accept(frame(number, armed, time_us), 0.0) is not None
    assert (statistics.lost, statistics.device_skipped) == (4, 5)


def test_without_a_stream_no_sample_is_skipped():
    statistics = LinkStatistics()
    validator = SampleValidator(statistics)
    armed = validator.arm()
    for number, time_us in [(0, 1000), (1, 900_000)]:
        assert validator.accept(frame(number, armed, time_us), 0.0) is not None
    assert statistics.device_skipped == 0


@given(
    st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 1999)), max_size=200)
)
@example([(0, 0, 1999), (0, 0, 0)])
def test_lost_and_skipped_samples_are_counted_separately(steps: list[tuple[int, int, int]]):
    """Each sample is late by less than its period of 2 ms."""
    statistics = LinkStatistics()
    validator = SampleValidator(statistics)
    armed = validator.arm(2000)
    assert validator.accept(frame(0, armed), 0.0) is not None
    number = instant = 0
    for lost, skipped, late_us in steps:
        number += 1 + lost
        instant += 1 + lost + skipped
        time_us = instant * 2000 + late_us
        assert validator.accept(frame(number, armed, time_us), 0.0) is not None
    assert statistics.lost == sum(lost for lost, _, _ in steps)
    assert statistics.device_skipped == sum(skipped for _, skipped, _ in steps)


@given(U32, st.lists(st.integers(1, 5), min_size=1, max_size=50))
def test_numbers_may_wrap_anywhere(start: int, steps: list[int]):
    statistics = LinkStatistics()
    validator = SampleValidator(statistics)
    validator.number = start
    armed = validator.arm()
    assert validator.accept(frame(start, armed), 0.0) is not None
    number = start
    for sequence, step in enumerate(steps):
        number = (number + step) % 2**32
        sample = validator.accept(frame(number, validator.command(sequence)), 0.0)
        assert sample is not None
        assert sample.sequence == sequence
        assert validator.last_command_echoed
    assert statistics.lost == sum(steps) - len(steps)
    assert statistics.rejected == 0


@given(U32, st.lists(st.integers(-800, 2**31 - 1), max_size=20))
def test_the_devices_clock_is_unwrapped(start_us: int, steps: list[int]):
    """The clock may step back a little; 35 minutes between two samples are no wrap."""
    validator = SampleValidator(LinkStatistics())
    now = start_us
    for step in [0, *steps]:
        now += step
        sample = validator.convert(frame(0, 0, now % 2**32), 0.0)
        assert sample.device_time_s == pytest.approx(now * 1e-6, abs=1e-9, rel=1e-15)


@given(U32, U32, U32, U32)
def test_only_echoes_between_the_arming_and_the_last_command_are_accepted(
    start: int, echo: int, number: int, sent: int
):
    validator = SampleValidator(LinkStatistics())
    validator.number = start
    armed = validator.arm()
    for k in range(sent % 5):
        validator.command(k)
    between = (echo - armed) % 2**32 <= sent % 5
    assert (validator.accept(frame(number, echo), 0.0) is not None) == between


@given(
    st.tuples(*[st.integers(-(2**31), 2**31 - 1)] * 3),
    st.lists(st.tuples(*[st.integers(-(2**30), 2**30)] * 3), max_size=8),
)
def test_counts_are_unwrapped_at_32_bits(start, steps):
    validator = SampleValidator(LinkStatistics())
    counts = list(start)
    for step in [(0, 0, 0), *steps]:
        counts = [c + s for c, s in zip(counts, step, strict=True)]
        roll, pitch, yaw = ((c + 2**31) % 2**32 - 2**31 for c in counts)
        sent = replace(frame(0, 0), roll=roll, pitch=pitch, yaw=yaw)
        assert validator.convert(sent, 0.0).counts == tuple(counts)
