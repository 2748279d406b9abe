"""The host always gets the newest sample; on a virtual clock."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from heli3dof_drivers.quanser_hil import stream
from heli3dof_drivers.quanser_hil.stream import EncoderStream, Ended, Overrun
from hypothesis import given
from hypothesis import strategies as st

from .stand_in import OVERFLOW, HILError

DT = 0.002


class Clock:
    """A host's clock and a board that samples by its own clock."""

    error = HILError

    def __init__(self, ppm: float = 0.0) -> None:
        self.now = 100.0
        self.period = DT * (1 + ppm * 1e-6)
        self.reads: list[int] = []
        self.ended = False
        self.kept_s = 0.0
        """s for which the host stalls in its next read"""
        self.starts_late_s = 0.0

    def monotonic(self) -> float:
        self.now += 1e-6  # reading the clock takes time
        return self.now

    def task_start(self, rate_hz: float, samples: int) -> Any:
        assert rate_hz == pytest.approx(1 / DT)
        start = self.now + self.starts_late_s
        return SimpleNamespace(start=start, taken=0, capacity=samples)

    def task_read(self, task: Any, n: int) -> tuple[int, int, int] | None:
        self.reads.append(n)
        if self.ended:
            return None
        task.taken += n
        came = task.start + task.taken * self.period
        if self.now - came > task.capacity * self.period:
            raise HILError(-OVERFLOW)
        self.now = max(self.now, came) + 10e-6 + self.kept_s
        self.kept_s = 0.0
        return task.taken, -task.taken, 0

    def task_end(self, task: Any) -> None:
        pass

    def newest(self, task: Any) -> int:
        """Number of samples that the board has taken."""
        return int((self.now - task.start) / self.period)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    return running(Clock(), monkeypatch)


def running(clock: Clock, monkeypatch: pytest.MonkeyPatch) -> Clock:
    monkeypatch.setattr(stream, "time", clock)
    return clock


def started(clock: Clock) -> EncoderStream:
    made = EncoderStream(clock, DT)  # type: ignore[arg-type]
    made.start()
    made.next()
    return made


def period(clock: Clock, made: EncoderStream, busy_s: float) -> tuple[int, int, int]:
    """One control period of a host that is busy for ``busy_s``."""
    clock.now += busy_s
    made.discard_waiting()
    return made.next()


def test_a_punctual_host_reads_one_sample_per_period(clock: Clock):
    made = started(clock)
    for k in range(2, 1000):
        assert period(clock, made, 0.3 * DT) == (k, -k, 0)
    assert set(clock.reads) == {1}


def test_a_host_that_stalled_gets_the_newest_sample_and_no_burst(clock: Clock):
    made = started(clock)
    period(clock, made, 0.3 * DT)
    before = made.time_s
    counts = period(clock, made, 5.5 * DT)
    assert counts[0] == clock.newest(made._task)
    assert made.time_s - before == pytest.approx(6 * DT)
    clock.reads.clear()
    for _ in range(10):
        period(clock, made, 0.3 * DT)
    assert clock.reads == [1] * 10


@pytest.mark.parametrize("ppm", [-2000, -100, 100, 2000])
def test_a_boards_clock_error_costs_no_sample(monkeypatch: pytest.MonkeyPatch, ppm: float):
    clock = running(Clock(ppm), monkeypatch)
    made = started(clock)
    for _ in range(30_000):  # a minute
        period(clock, made, 0.3 * DT)
    assert set(clock.reads) == {1}


def test_a_board_that_starts_its_clock_late_costs_no_sample(clock: Clock):
    clock.starts_late_s = 5.3 * DT
    made = started(clock)
    for _ in range(100):
        period(clock, made, 0.3 * DT)
    assert set(clock.reads) == {1}


def test_a_host_that_stalled_while_waiting_gets_no_burst(clock: Clock):
    made = started(clock)
    period(clock, made, 0.3 * DT)
    clock.kept_s = 3.4 * DT
    clock.reads.clear()
    counts = period(clock, made, 0.3 * DT)
    assert clock.reads == [1, 3]
    assert counts[0] == clock.newest(made._task)
    assert made.statistics.samples_stale == 3
    assert made.statistics.lost == 0
    clock.reads.clear()
    for _ in range(10):
        period(clock, made, 0.3 * DT)
    assert clock.reads == [1] * 10


@given(busy=st.lists(st.tuples(st.floats(0, 20), st.floats(0, 20)), min_size=1, max_size=60))
def test_no_returned_sample_is_older_than_a_period(busy: list[tuple[float, float]]):
    with pytest.MonkeyPatch.context() as patch:
        clock = running(Clock(), patch)
        made = started(clock)
        for before, within in busy:
            clock.now += before * DT
            made.discard_waiting()
            clock.kept_s = within * DT
            counts = made.next()
            assert counts[0] >= clock.newest(made._task) - 1
            assert made.time_s == pytest.approx(counts[0] * DT, abs=1e-6)


def test_a_wrong_clock_offset_is_corrected(clock: Clock):
    made = started(clock)
    made._offset -= 7 * DT  # as if samples were due that were never taken
    for _ in range(4):
        period(clock, made, 0.3 * DT)
    clock.reads.clear()
    for _ in range(50):
        period(clock, made, 0.3 * DT)
    assert clock.reads == [1] * 50


def test_an_overrun_is_raised_and_a_new_task_continues_the_time(clock: Clock):
    made = started(clock)
    before = made.time_s
    clock.now += 10.0
    with pytest.raises(Overrun):
        made.discard_waiting()
    made.start(overrun=True)
    made.next()
    assert made.time_s - before == pytest.approx(10.0, abs=3 * DT)
    assert made.statistics.lost == pytest.approx(10.0 / DT, abs=3)
    assert made.statistics.tasks == 2


def test_the_end_of_a_task_is_raised(clock: Clock):
    made = started(clock)
    clock.ended = True
    with pytest.raises(Ended):
        made.next()
