"""The board keeps the time: its encoder task samples on, and the host takes the newest.

A task fills its buffer at its own rate; reading one sample blocks until there is one. How many
are waiting the library does not say, and a host that was late must not fly them one by one. But a
read that had to wait found the buffer empty, so its sample k was fresh::

    due[k] = h[fresh] + (k − fresh)·dt          waiting = ⌊(now − due[k]) / dt⌋

and a sample that comes before it was due shows that it was due earlier. Those that wait are read
together, the last of them counts, and the device's time steps over the others.
"""

from __future__ import annotations

import time
from typing import Any

from .card import Card
from .errors import OVERRUN, code_of

BUFFER_S = 2.0
"""s of samples that the board keeps: longer than the longest watchdog"""
BLOCKED = 0.1
"""Of a period: a read that took longer had to wait for its sample"""

Counts = tuple[int, int, int]


class Overrun(Exception):
    """The buffer ran over: samples are lost, and the task has ended."""


class Ended(Exception):
    """The task gives no more samples, though nobody here ended it."""


class EncoderStream:
    """The running task, and the device's time: s since the board was opened."""

    def __init__(self, card: Card, dt: float) -> None:
        self._card, self._dt = card, dt
        self._samples = max(2, round(BUFFER_S / dt))
        self._task: Any = None
        self._k = self._fresh_k = 0
        self._base_s = 0.0
        self._fresh_s = time.monotonic()

    @property
    def running(self) -> bool:
        return self._task is not None

    @property
    def time_s(self) -> float:
        """The last sample's device time."""
        return self._base_s + self._k * self._dt

    def now_s(self) -> float:
        """The device's time now; not before the last sample's."""
        return self.time_s + max(0.0, time.monotonic() - self._due_s())

    def start(self) -> None:
        """Begin anew with an empty buffer; the device's time goes on."""
        self.end()
        self._base_s = self.now_s()
        self._k = self._fresh_k = 0
        self._task = self._card.task_start(1 / self._dt, self._samples)
        self._fresh_s = time.monotonic()

    def end(self) -> None:
        task, self._task = self._task, None
        if task is not None:
            self._card.task_end(task)

    def pass_over(self) -> None:
        """What was sampled before now is of no use."""
        waiting = self._waiting()
        if waiting:
            self._read(waiting)

    def next(self) -> Counts:
        """The next sample, or the newest where several have come."""
        counts = self._read(1)
        waiting = self._waiting()
        return self._read(waiting) if waiting else counts

    def _waiting(self) -> int:
        gone = int((time.monotonic() - self._due_s()) / self._dt)
        return max(0, min(gone, self._samples))

    def _due_s(self) -> float:
        return self._fresh_s + (self._k - self._fresh_k) * self._dt

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
        now = time.monotonic()
        if now - asked > BLOCKED * self._dt or now < self._due_s():
            self._fresh_k, self._fresh_s = self._k, now
        return counts
