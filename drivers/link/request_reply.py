"""Questions and answers over a transport, with patience and a count of everything.

An answer carries its question's number, so a late answer to an earlier try is an answer too, and
one to another question never is. Samples that arrive meanwhile are kept for whoever wants them.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from typing import TypeVar

from .frames import Frame, SampleFrame, Splitter, wire
from .link_statistics import LinkStatistics
from .transport import Transport

TRIES = 3
PATIENCE_S = 0.2
"""s for each try"""
OVERHEARD = 256
"""bytes of what came last, kept for a diagnosis"""
F = TypeVar("F")


class Dialogue:
    """One host's end of one line."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.statistics = LinkStatistics()
        self.samples: deque[tuple[SampleFrame, float]] = deque(maxlen=4096)
        """Samples not yet looked at, and when they came (host's monotonic clock, s)"""
        self.overheard = b""
        """The last bytes that came while a question was open"""
        self.trip_s = 0.0
        """s that the last question took to be answered"""
        self._splitter = Splitter()
        self._number = 0

    def next_number(self) -> int:
        """For questions; apart from the commands' numbers, which have an order."""
        self._number = (self._number + 1) & 0xFFFFFFFF
        return self._number

    def send(self, data: bytes) -> None:
        """One frame's bytes."""
        self.transport.write(data)
        self.statistics.sent += 1

    def receive(self, timeout_s: float) -> list[Frame]:
        """Other frames than samples, of the bytes that come next; samples go to ``samples``."""
        return self._sorted(self.transport.read(timeout_s))

    def _sorted(self, data: bytes) -> list[Frame]:
        if not data:
            return []
        now = time.monotonic()
        others: list[Frame] = []
        frames = self._splitter.feed(data)
        for frame in frames:
            if type(frame) is SampleFrame:
                self.samples.append((frame, now))
            else:
                others.append(frame)
        self.statistics.received += len(frames)
        self.statistics.damaged = self._splitter.damaged
        return others

    def ask(
        self,
        question: Callable[[int], Frame],
        answer: Callable[[Frame, set[int]], F | None],
        *,
        tries: int = TRIES,
        patience_s: float = PATIENCE_S,
    ) -> F | None:
        """Ask until ``answer`` recognises one; None when nobody does.

        ``question`` makes the frame from a fresh number; ``answer`` is shown every frame, and the
        numbers asked so far.
        """
        numbers: set[int] = set()
        self.overheard = b""
        for attempt in range(tries):
            number = self.next_number()
            numbers.add(number)
            self.statistics.repeats += attempt > 0
            asked = time.monotonic()
            self.send(wire(question(number)))
            again = time.monotonic() + patience_s
            while (left := again - time.monotonic()) > 0:
                data = self.transport.read(left)
                self.overheard = (self.overheard + data)[-OVERHEARD:]
                for frame in self._sorted(data):
                    found = answer(frame, numbers)
                    if found is not None:
                        self.trip_s = time.monotonic() - asked
                        self.statistics.round_trip.add(self.trip_s)
                        return found
        return None

    def drain(self) -> None:
        """Read whatever has come, without waiting."""
        for _ in range(64):
            data = self.transport.read(0.0)
            if not data:
                return
            self._sorted(data)
