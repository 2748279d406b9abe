"""Reads the newest sample of the board's encoder task, which samples by the board's own clock.

The task stores sample k in a buffer at device time d = k·dt; reading waits until the buffer has a
sample. The library does not report how many samples are waiting, but a late host must skip the old
ones. So the driver estimates θ, host time minus device time in s: the sample of device time d is
expected at host time d + θ. If the host reads it at host time h,

    θ[k] = min(h − d,  θ[k−1] + DRIFT·dt)  if the read had to wait, so that the sample is new
    θ[k] = min(h − d,  θ[k−1])             if the sample was already in the buffer

`DRIFT` bounds how slow the board's clock may run (s per s). A host stall during a read hardly
changes θ, because θ rises by at most DRIFT·dt per sample. With the host's present time t and the
device time d of the last sample read, the number of samples in the buffer is

    waiting = ⌊(t − d − θ) / dt⌋

These samples are read together, and only the last one is used. If two reads in succession have to
wait for samples that should be in the buffer, θ is wrong, and its estimation restarts.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

from .board import Board
from .error_codes import OVERRUN, code_of

BUFFER_S = 2.0
"""s of samples that the board buffers: longer than the longest watchdog (1 s)"""
BLOCKED = 0.1
"""Share of a period: a read that took longer has waited for its sample"""
DRIFT = 0.01
"""s per s by which a board's clock may run slow; a crystal is within 1e-4"""
DOUBTS = 2
"""Successive reads without the expected samples in the buffer that restart the estimation of θ"""

Counts = tuple[int, int, int]


class Overrun(Exception):
    """Raised when the task's buffer overflowed: samples are lost, and the task has ended."""


class Ended(Exception):
    """Raised when the encoder task has ended although this program did not end it."""


@dataclass
class StreamStatistics:
    """Counts of samples and encoder tasks since the Quanser board was opened."""

    samples: int = 0
    """Taken by the board and read by this program"""
    samples_stale: int = 0
    """Those of `samples` that were not used, because a newer one was waiting"""
    lost: int = 0
    """Periods without a sample because the buffer had overflowed"""
    tasks: int = 0
    """Encoder tasks started"""


class EncoderStream:
    """Reads the samples of a board's encoder task and computes their device times.

    ``dt``: sample period in s. Sample k of a task has the device time k·dt after the task's start.
    """

    def __init__(self, board: Board, dt: float) -> None:
        self._board, self._dt = board, dt
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
        """Return the device's time of the last sample, in s since the board was opened."""
        return self._base_s + self._k * self._dt

    def now_s(self) -> float:
        """Return the present device time in s; it is never before the time of the last sample."""
        return self.time_s + max(0.0, self._late_s())

    def start(self, *, overrun: bool = False) -> None:
        """Start a task with an empty buffer; the device's time continues.

        ``overrun``: the last task's buffer overflowed. Then the periods since its last sample count
        as lost.
        """
        self.end()
        before_s, self._base_s = self.time_s, self.now_s()
        if overrun:
            self.statistics.lost += round((self._base_s - before_s) / self._dt)
        self.statistics.tasks += 1
        self._k, self._offset, self._doubts = 0, None, 0
        self._task = self._board.task_start(1 / self._dt, self._samples)

    def end(self) -> None:
        task, self._task = self._task, None
        if task is not None:
            self._board.task_end(task)

    def next(self) -> Counts:
        """Return the counts of the next sample, or of the newest if several are waiting."""
        counts = self._read(1)
        return self.discard_waiting() or counts

    def discard_waiting(self) -> Counts | None:
        """Read the samples that are waiting in the board's buffer; return the newest, or None."""
        counts: Counts | None = None
        while waiting := self._waiting():
            start = time.monotonic()
            counts = self._read(waiting)
            self.statistics.samples_stale += waiting
            if time.monotonic() - start < waiting * self._dt / 2:
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
        if self._offset is None:
            return 0.0
        return time.monotonic() - self.time_s - self._offset

    def _read(self, n: int) -> Counts:
        start = time.monotonic()
        try:
            counts = self._board.task_read(self._task, n)
        except self._board.error as error:
            if code_of(error) in OVERRUN:
                raise Overrun from error
            raise
        if counts is None:
            raise Ended
        self._k += n
        self.statistics.samples += n
        now = time.monotonic()
        offset = now - self.time_s
        if self._offset is None:
            self._offset = offset
        elif now - start > BLOCKED * self._dt:
            self._offset = min(offset, self._offset + DRIFT * n * self._dt)
        else:
            self._offset = min(offset, self._offset)
        return counts
