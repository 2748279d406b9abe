"""Sends requests and receives their replies over a transport, with timeouts, retries and counters.

A reply repeats its request's number. So a late reply to an earlier attempt is accepted, but a reply
to another request is not. Samples that arrive before the reply are queued.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from heli3dof.rig.histogram import Histogram

from .frames import Ack, Frame, SampleFrame, Splitter, wire

TRIES = 3
REPLY_TIMEOUT_S = 0.2
"""s that each attempt waits for its reply"""
TAIL = 256
"""Most recent bytes that are kept to describe an unknown device"""
F = TypeVar("F", bound=Frame)


class Transport(Protocol):
    """An open connection to one device: a serial line or USB pipes, which carry the link's bytes.

    Every method but ``close`` raises DeviceError if the device is unplugged, not permitted, or
    accepts no more bytes.
    """

    @property
    def name(self) -> str:
        """Return the connection's name for messages: a port or a URL."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived; b"" if none arrive within ``timeout_s`` seconds."""
        ...

    def close(self) -> None:
        """Close the connection. Never raises an error; a second call does nothing."""
        ...


@dataclass
class LinkStatistics:
    """Counts of frames and samples, and distributions of times, since the connection was opened."""

    sent: int = 0
    """Frames to the device"""
    received: int = 0
    """Valid frames from the device"""
    malformed: int = 0
    """Pieces between delimiters that were not a valid frame"""
    lost: int = 0
    """Samples that the device took and that never arrived: their numbers are missing"""
    device_skipped: int = 0
    """Samples that a busy device did not take: its time jumped, but no number is missing"""
    samples_stale: int = 0
    """Valid samples that were not used, because they were outdated.

    Such a sample arrived

    - together with a newer one,
    - before the host waited for a sample,
    - in reply to a POLL before the last command.
    """
    rejected: int = 0
    """Valid frames with an impossible sample: a repeated number, or an echo of no sent command"""
    commands: int = 0
    commands_unacknowledged: int = 0
    """Commands that the next sample did not echo: lost, refused, or still on their way"""
    retries: int = 0
    """Requests sent again because no reply arrived"""
    round_trip: Histogram = field(default_factory=Histogram)
    """s from a request to its reply"""
    delay: Histogram = field(default_factory=Histogram)
    """s on the device's clock from a sample to the arrival of the next command at the device.

    This delay is the loop's latency modulo the sample period.
    """


class RequestClient:
    """The host's end of a connection: sends requests, returns replies and queues samples."""

    def __init__(self, transport: Transport) -> None:
        self.transport = transport
        self.statistics = LinkStatistics()
        self.samples: deque[tuple[SampleFrame, float]] = deque(maxlen=4096)
        """Samples not yet processed, and when they arrived (host's monotonic clock, s)"""
        self.tail = b""
        """The last bytes received during the last request"""
        self.round_trip_s = 0.0
        """s from the last request to its reply"""
        self._splitter = Splitter()
        self._number = 0

    def next_number(self) -> int:
        """Return a new frame number for a request; commands are numbered separately."""
        self._number = (self._number + 1) & 0xFFFFFFFF
        return self._number

    def send(self, data: bytes) -> None:
        """Send ``data``, the bytes of one frame, and count it as sent."""
        self.transport.write(data)
        self.statistics.sent += 1

    def receive(self, timeout_s: float) -> list[Frame]:
        """Wait up to ``timeout_s`` s for bytes; queue samples, return the other frames."""
        return self._process(self.transport.read(timeout_s))

    def _process(self, data: bytes) -> list[Frame]:
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
        self.statistics.malformed = self._splitter.malformed
        return others

    def request(
        self,
        make: Callable[[int], Frame],
        reply: type[F] | tuple[type[F], ...],
        *,
        tries: int = TRIES,
    ) -> F | None:
        """Send a request up to ``tries`` times; return its reply, or None if no attempt got one.

        ``make(number)`` returns the request frame with this number; each attempt has a new number.
        ``reply``: the class of the reply frame. A reply repeats the number of its attempt, and a
        late reply to an earlier attempt is accepted. An `Ack` is accepted only if it names the
        request's type. Each attempt waits `REPLY_TIMEOUT_S` s.
        """
        numbers: set[int] = set()
        self.tail = b""
        for attempt in range(tries):
            frame = make(self.next_number())
            numbers.add(frame.number)
            self.statistics.retries += attempt > 0
            sent_s = time.monotonic()
            self.send(wire(frame))
            deadline = time.monotonic() + REPLY_TIMEOUT_S
            while (left := deadline - time.monotonic()) > 0:
                data = self.transport.read(left)
                self.tail = (self.tail + data)[-TAIL:]
                for other in self._process(data):
                    if not isinstance(other, reply) or other.number not in numbers:
                        continue
                    if isinstance(other, Ack) and other.request != frame.TYPE:
                        continue
                    self.round_trip_s = time.monotonic() - sent_s
                    self.statistics.round_trip.add(self.round_trip_s)
                    return other
        return None

    def drain(self) -> None:
        """Queue the samples that have arrived, without waiting; discard other frames."""
        for _ in range(64):
            data = self.transport.read(0.0)
            if not data:
                return
            self._process(data)
