"""How a rig on the link comes by its samples: out of the stream, or one for each POLL.

Of several that came together the newest counts; those before it, and those that had come before
they were wanted, are passed over and counted. A POLL that stays without an answer is repeated
after four times what the last one took; its answer may then come twice, and the second of the two
was sampled before the next exchange's command: `_stale` counts how many such may still come.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from heli3dof.rig.interface import Flags, Sample

from .frames import Poll, wire
from .request_reply import Dialogue

if TYPE_CHECKING:
    from .sample_validation import Intake

SILENCE_S = 0.5
"""s without the sample that was due until the rig counts as gone; its watchdog is quicker"""
SOONEST_AGAIN_S, LATEST_AGAIN_S = 5e-3, 0.1
"""s until a POLL that stays without an answer is repeated in flight. On the ground nothing
hurries, and the longest is waited for."""


class Sampling:
    """The samples of one open rig. ``armed``: they are judged by echo and number."""

    def __init__(self, dialogue: Dialogue, intake: Intake) -> None:
        self._dialogue, self._intake = dialogue, intake
        self.armed = False
        self._again_s = SOONEST_AGAIN_S
        self._stale = 0
        """answers that may still come to POLLs of the exchange before"""

    def next_of_stream(self) -> Sample | None:
        """The device's next sample; None when none came for `SILENCE_S`."""
        until = time.monotonic() + SILENCE_S
        while (sample := self._newest()) is None:
            left = until - time.monotonic()
            if left <= 0:
                return None
            self._dialogue.receive(left)
        self._dialogue.statistics.commands_unacknowledged += not self._intake.heard
        return sample

    def first(self) -> Sample | None:
        """The sample that follows the ARM of a polled device; None when none came."""
        until = time.monotonic() + SILENCE_S
        while time.monotonic() < until:
            sample = self._newest()
            if sample is not None:
                return sample
            self._dialogue.receive(LATEST_AGAIN_S)
            if not self._dialogue.samples:
                return self.poll()
        return None

    def poll(self) -> Sample | None:
        """A sample now; None when none came for `SILENCE_S`."""
        dialogue, statistics = self._dialogue, self._dialogue.statistics
        self.pass_over()
        first, sent = time.monotonic(), 0
        again_s = self._again_s if self.armed else LATEST_AGAIN_S
        while time.monotonic() < first + SILENCE_S:
            dialogue.send(wire(Poll(dialogue.next_number())))
            sent += 1
            again = time.monotonic() + again_s  # from now on: a slow line is listened to, too
            while (left := again - time.monotonic()) > 0:
                dialogue.receive(left)
                stale = self._stale
                sample = self._newest()
                if sample is None:
                    continue
                if stale and sample.flags & Flags.ENABLED and not self._intake.heard:
                    statistics.passed_over += 1  # else every exchange would be one behind
                    continue
                self._stale = sent - 1
                trip_s = sample.host_time_s - first
                statistics.round_trip.add(trip_s)
                self.took(trip_s)
                statistics.commands_unacknowledged += self.armed and not self._intake.heard
                return sample
            statistics.repeats += 1
        return None

    def took(self, trip_s: float) -> None:
        """What the last question took: the next POLL is repeated after four times that."""
        self._again_s = min(max(4 * trip_s, SOONEST_AGAIN_S), LATEST_AGAIN_S)

    def pass_over(self) -> None:
        """What was sampled before now is of no use."""
        self._dialogue.drain()
        if self._newest() is not None:
            self._dialogue.statistics.passed_over += 1

    def _newest(self) -> Sample | None:
        """The newest of the samples that have come and can be; the others are passed over."""
        samples = self._dialogue.samples
        take = self._intake.take if self.armed else self._intake.sample
        newest: Sample | None = None
        while samples:
            frame, came_s = samples.popleft()
            sample = take(frame, came_s)
            if sample is not None:
                self._stale = max(0, self._stale - 1)
                self._dialogue.statistics.passed_over += newest is not None
                newest = sample
        return newest
