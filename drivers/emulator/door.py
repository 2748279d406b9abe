"""An emulated rig behind a file descriptor: bytes in, bytes out, on the machine's own clock."""

from __future__ import annotations

import os
import select
import time
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


def serve(endpoint: Endpoint, fd: int, going: Callable[[], bool] = lambda: True) -> None:
    """Be the device at this descriptor until ``going`` says no or the descriptor closes."""
    os.set_blocking(fd, False)
    start = time.monotonic_ns() // 1000
    waiting = b""
    while going():
        now = time.monotonic_ns() // 1000 - start
        due = endpoint.next_us()
        left = min(IDLE_US, IDLE_US if due is None else due - now)
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
        said = endpoint.receive(now, data) if data else endpoint.tick(now)
        if len(waiting) + len(said) <= FULL:
            waiting += said
        if waiting:
            try:
                waiting = waiting[os.write(fd, waiting) :]
            except BlockingIOError:
                pass
            except OSError:
                return
