"""Reads a device's samples, which the device streams or sends in reply to a POLL.

A POLL is the host's request for one sample (docs/reference/protocol.md). If several samples have
arrived together, `Sampling` returns the newest and discards the others as stale. Samples that
arrived before the host began to wait for a sample are stale, too.

If no reply to a POLL arrives in time, `Sampling` sends the POLL again. The waiting time is about
four times the last round-trip time if the rig is armed, and `LONGEST_RETRY_S` if it is not.

The first reply may only have been late. The device then replies to both POLLs, and the second reply
is superfluous. It may still arrive after the host has sent its next command and next POLL.
`Sampling` must not use it as the reply to the next POLL, because its sample is too old. Each sample
contains the number of the last command that the device has applied. If this is not the number of
the host's last command, `Sampling` discards the sample. It does so only while the rig is armed and
superfluous replies may still arrive. `_extra_replies` is the number of these replies.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

from heli3dof.rig.interface import Flags, Sample

from .frames import Poll, wire
from .request_reply import RequestClient

if TYPE_CHECKING:
    from .sample_validation import SampleValidator

SILENCE_S = 0.5
"""s without a sample after which the rig counts as gone; most watchdogs expire earlier"""
SHORTEST_RETRY_S, LONGEST_RETRY_S = 5e-3, 0.1
"""s: limits of the time until a POLL is repeated while the rig is armed. If it is not armed, the
time is `LONGEST_RETRY_S`"""


class Sampling:
    """Reads the samples of one open rig; while the rig is armed, rejects invalid samples."""

    def __init__(self, client: RequestClient, validator: SampleValidator) -> None:
        self._client, self._validator = client, validator
        self.armed = False
        self._retry_s = SHORTEST_RETRY_S
        self._extra_replies = 0
        self._valid = (time.monotonic(), 0, 0)
        """Time of the last valid sample (s, monotonic); frames malformed and rejected until then"""

    def since_valid(self) -> tuple[float, int, int]:
        """Return the time in s since the last valid sample, and two counts of frames since then.

        The counts are (malformed frames, rejected frames).
        """
        statistics, (then_s, malformed, rejected) = self._client.statistics, self._valid
        return (
            time.monotonic() - then_s,
            statistics.malformed - malformed,
            statistics.rejected - rejected,
        )

    def next_of_stream(self) -> Sample | None:
        """Return the stream's next sample; None if none arrives within `SILENCE_S` seconds."""
        deadline = time.monotonic() + SILENCE_S
        while (sample := self._newest()) is None:
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            self._client.receive(left)
        statistics = self._client.statistics
        statistics.commands_unacknowledged += not self._validator.last_command_echoed
        return sample

    def first(self) -> Sample | None:
        """Return the first sample after arming a rig that sends no stream of samples.

        The result is None if no sample arrives.
        """
        deadline = time.monotonic() + SILENCE_S
        while time.monotonic() < deadline:
            sample = self._newest()
            if sample is not None:
                return sample
            self._client.receive(LONGEST_RETRY_S)
            if not self._client.samples:
                return self.poll()
        return None

    def poll(self) -> Sample | None:
        """Request a sample and return it; None if none arrives within `SILENCE_S` seconds."""
        client, statistics = self._client, self._client.statistics
        self.discard_stale()
        first_s, sent = time.monotonic(), 0
        retry_s = self._retry_s if self.armed else LONGEST_RETRY_S
        while time.monotonic() < first_s + SILENCE_S:
            client.send(wire(Poll(client.next_number())))
            sent += 1
            deadline = time.monotonic() + retry_s  # from now: writing to a slow line takes time
            while (left := deadline - time.monotonic()) > 0:
                client.receive(left)
                extra = self._extra_replies
                sample = self._newest()
                if sample is None:
                    continue
                echoed = self._validator.last_command_echoed
                if extra and sample.flags & Flags.ENABLED and not echoed:
                    statistics.samples_stale += 1  # else every exchange would use an old reply
                    continue
                self._extra_replies = sent - 1
                round_trip_s = sample.host_time_s - first_s
                statistics.round_trip.add(round_trip_s)
                self.set_round_trip(round_trip_s)
                statistics.commands_unacknowledged += self.armed and not echoed
                return sample
            statistics.retries += 1
        return None

    def set_round_trip(self, round_trip_s: float) -> None:
        """Set how long `poll` waits for a reply of an armed rig before it repeats the POLL.

        This time is 4·``round_trip_s`` s, clipped to `SHORTEST_RETRY_S` … `LONGEST_RETRY_S`.
        """
        self._retry_s = min(max(4 * round_trip_s, SHORTEST_RETRY_S), LONGEST_RETRY_S)

    def discard_stale(self) -> None:
        """Discard the samples that have already arrived, and count them as stale."""
        self._client.drain()
        if self._newest() is not None:
            self._client.statistics.samples_stale += 1

    def _newest(self) -> Sample | None:
        """Return the newest valid sample that has arrived, or None; count older ones as stale."""
        samples = self._client.samples
        take = self._validator.accept if self.armed else self._validator.convert
        newest: Sample | None = None
        while samples:
            frame, arrived_s = samples.popleft()
            sample = take(frame, arrived_s)
            if sample is not None:
                self._extra_replies = max(0, self._extra_replies - 1)
                self._client.statistics.samples_stale += newest is not None
                newest = sample
        if newest is not None:
            statistics = self._client.statistics
            self._valid = (newest.host_time_s, statistics.malformed, statistics.rejected)
        return newest
