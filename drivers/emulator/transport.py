"""An emulated rig behind a file descriptor: bytes in, bytes out, on the machine's own clock."""

from __future__ import annotations

import os
import select
import time
from collections import deque
from collections.abc import Callable

from .endpoint import Endpoint

SPIN_US = 150
"""µs before a sample is due at which sleeping stops"""
IDLE_US = 20_000
FULL = 8192
"""bytes that wait for a host that does not read; what comes on top of them is lost, as on a wire"""


def emulated(url: str = "mock:") -> Endpoint:
    """The device side of the rig that a ``mock:`` URL describes, just started.

    The first period is compiled before this returns. Raises UsageError for a bad option.
    """
    from heli3dof.rig.profile import default_profile
    from heli3dof.rig.url import parse_url

    from ..mock import MockDriver

    rig = MockDriver().open(parse_url(url), default_profile())
    return Endpoint(
        rig.device,
        counts_per_rev=rig.identity.counts_per_rev,
        serial=rig.identity.serial,
        boot=int.from_bytes(os.urandom(4), "little"),
    )


class Delay:
    """A line on which every byte takes ``delay_us``; 0: it arrives at once."""

    def __init__(self, delay_us: int = 0) -> None:
        self._delay_us = delay_us
        self._on_the_way: deque[tuple[int, bytes]] = deque()

    def put(self, now_us: int, data: bytes) -> None:
        if data:
            self._on_the_way.append((now_us + self._delay_us, data))

    def get(self, now_us: int) -> bytes:
        """What has arrived by now."""
        out = b""
        while self._on_the_way and self._on_the_way[0][0] <= now_us:
            out += self._on_the_way.popleft()[1]
        return out

    def next_us(self) -> int | None:
        """When something arrives; None: nothing is on its way."""
        return self._on_the_way[0][0] if self._on_the_way else None


def serve(
    endpoint: Endpoint,
    fd: int,
    going: Callable[[], bool] = lambda: True,
    *,
    delay_us: int = 0,
) -> None:
    """Be the device at this descriptor until ``going`` says no or the descriptor closes.

    ``delay_us``: how long every byte takes on the line, in each direction.
    """
    os.set_blocking(fd, False)
    start = time.monotonic_ns() // 1000
    waiting = b""
    there, back = Delay(delay_us), Delay(delay_us)
    while going():
        now = time.monotonic_ns() // 1000 - start
        dues = (endpoint.next_us(), there.next_us(), back.next_us())
        left = min([IDLE_US, *(due - now for due in dues if due is not None)])
        # Spin to the end: a sleep overshoots by more than a sample may be late.
        sleep_s = max(0, left - SPIN_US) * 1e-6 if left < IDLE_US else left * 1e-6
        ready, _, _ = select.select([fd], [fd] if waiting else [], [], sleep_s)
        data = b""
        if ready:
            try:
                data = os.read(fd, 4096)
            except BlockingIOError:
                pass
            except OSError:
                return
        now = time.monotonic_ns() // 1000 - start
        endpoint.held_up(now)
        there.put(now, data)
        arrived = there.get(now)
        back.put(now, endpoint.receive(now, arrived) if arrived else endpoint.tick(now))
        said = back.get(now)
        if len(waiting) + len(said) <= FULL:
            waiting += said
        if waiting:
            try:
                waiting = waiting[os.write(fd, waiting) :]
            except BlockingIOError:
                pass
            except OSError:
                return
