"""The board keeps the time: its encoder task samples on, and the host takes the newest.

A task fills its buffer at its own rate d = k·dt; reading one sample blocks until there is one. How
many are waiting the library does not say, and a host that was late must not fly them one by one.
So the two clocks are followed: a sample read at host time h is due at d + θ, and

    θ[k] = min(h − d,  θ[k−1] + DRIFT·dt)  where the read had to wait for it, so it was fresh
    θ[k] = min(h − d,  θ[k−1])             where it did not
    waiting = ⌊(now − d − θ) / dt⌋

Those that wait are read together, the last of them counts, and the device's time steps over the
others. A host that was kept from running while it waited sees that too: θ does not follow a
jump. Where samples that should have been waiting had to be waited for, twice, θ was wrong and
begins anew.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from .board import Card
from .error_codes import OVERRUN, code_of

BUFFER_S = 2.0
"""s of samples that the board keeps: longer than the longest watchdog"""
BLOCKED = 0.1
"""Of a period: a read that took longer had to wait for its sample"""
DRIFT = 0.01
"""s per s by which a board's clock may run slow; a crystal is a hundred times better"""
DOUBTS = 2
"""Times that samples were not waiting after all, until the clocks are compared anew"""

Counts = tuple[int, int, int]


class Overrun(Exception):
    """The buffer ran over: samples are lost, and the task has ended."""


class Ended(Exception):
    """The task gives no more samples, though nobody here ended it."""


@dataclass
class StreamStatistics:
    """Since the board was opened."""

    samples: int = 0
    """That the board took and this program read"""
    passed_over: int = 0
    """Of them, those that waited for too long to be of use"""
    lost: int = 0
    """Periods without a sample because the buffer had run over"""
    tasks: int = 0
    """Encoder tasks begun"""


class EncoderStream:
    """The running task, and the device's time: s since the board was opened."""

    def __init__(self, card: Card, dt: float) -> None:
        self._card, self._dt = card, dt
        self._samples = max(2, round(BUFFER_S / dt))
        self._task: Any = None
        self._k = 0
        self._base_s = 0.0
        self._offset: float | None = time.monotonic()
        self._doubts = 0
        self.statistics = StreamStatistics()

    @property
    def running(self) -> bool:
        return self._task is not None

    @property
    def time_s(self) -> float:
        """The last sample's device time."""
        return self._base_s + self._k * self._dt

    def now_s(self) -> float:
        """The device's time now; not before the last sample's."""
        return self.time_s + max(0.0, self._late_s())

    def start(self, *, overrun: bool = False) -> None:
        """Begin anew with an empty buffer; the device's time goes on."""
        self.end()
        before_s, self._base_s = self.time_s, self.now_s()
        if overrun:
            self.statistics.lost += round((self._base_s - before_s) / self._dt)
        self.statistics.tasks += 1
        self._k, self._offset, self._doubts = 0, None, 0
        self._task = self._card.task_start(1 / self._dt, self._samples)

    def end(self) -> None:
        task, self._task = self._task, None
        if task is not None:
            self._card.task_end(task)

    def pass_over(self) -> None:
        """What was sampled before now is of no use."""
        self._drain()

    def next(self) -> Counts:
        """The next sample, or the newest where several have come."""
        counts = self._read(1)
        return self._drain() or counts

    def _drain(self) -> Counts | None:
        """The newest of the samples that wait; None: there are none."""
        counts: Counts | None = None
        while waiting := self._waiting():
            asked = time.monotonic()
            counts = self._read(waiting)
            self.statistics.passed_over += waiting
            if time.monotonic() - asked < waiting * self._dt / 2:
                self._doubts = 0
                continue
            self._doubts += 1
            if self._doubts < DOUBTS:
                break
            self._offset, self._doubts = time.monotonic() - self.time_s, 0
        return counts

    def _waiting(self) -> int:
        return max(0, min(int(self._late_s() / self._dt), self._samples))

    def _late_s(self) -> float:
        """s since the last sample was due."""
        if self._offset is None:
            return 0.0
        return time.monotonic() - self.time_s - self._offset

    def _read(self, n: int) -> Counts:
        asked = time.monotonic()
        try:
            counts = self._card.task_read(self._task, n)
        except self._card.error as error:
            if code_of(error) in OVERRUN:
                raise Overrun from error
            raise
        if counts is None:
            raise Ended
        self._k += n
        self.statistics.samples += n
        now = time.monotonic()
        found = now - self.time_s
        if self._offset is None:
            self._offset = found
        elif now - asked > BLOCKED * self._dt:
            self._offset = min(found, self._offset + DRIFT * n * self._dt)
        else:
            self._offset = min(found, self._offset)
        return counts
