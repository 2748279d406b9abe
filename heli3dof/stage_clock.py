"""Report the stages of a long computation, and how long the rest of a stage will take."""

from __future__ import annotations

import time
from collections.abc import Callable

PROGRESS_EVERY_S = 1.0
"""Least time in s between two progress messages of the same stage. Chosen."""
Progress = Callable[[str], None]


class StageClock:
    """Report progress, and measure the wall-clock time of each stage.

    ``progress`` receives each message. ``seconds`` is {stage: time in s} of the stages that ended.
    """

    def __init__(self, progress: Progress) -> None:
        self.progress = progress
        self.seconds: dict[str, float] = {}
        self._stage, self._since = "", time.perf_counter()
        self._sentence, self._reported_at = "", self._since
        self._first: tuple[int, float] | None = None  # items and time at the first count

    def start(self, stage: str, sentence: str) -> None:
        self.stop()
        self._stage, self._sentence, self._reported_at = stage, sentence, self._since
        self._first = None
        self.progress(sentence)

    def counts(self, what: str, done: int, of: int) -> None:
        """Report that ``done`` of ``of`` items of the stage are finished, with the time left.

        ``what`` names the items: ``Screening … flights: 31 of 64, 4 s left``. No report is made
        within `PROGRESS_EVERY_S` of the last one. The time left follows from the items finished
        since the first call.
        """
        now = time.perf_counter()
        if self._first is None or done <= self._first[0]:
            self._first = done, now
        if now - self._reported_at >= PROGRESS_EVERY_S:
            self._reported_at = now
            counted = done - self._first[0]
            left = (now - self._first[1]) / counted * (of - done) if counted else None
            until = "" if left is None else f", {left:.0f} s left"
            self.progress(f"{self._sentence} {what}: {done} of {of}{until}")

    def stop(self) -> None:
        now = time.perf_counter()
        if self._stage:
            before = self.seconds.get(self._stage, 0.0)
            self.seconds[self._stage] = round(before + now - self._since, 2)
        self._stage, self._since = "", now
