"""Runs the emulated rig behind a pseudo-terminal, in real time, in a process of its own.

``python -m heli3dof_drivers.emulator.transport_pty --device 'mock:?hide=…&seed=…'``

Killing the process is like switching off a rig. The first line on stdout is the terminal's path,
which ``heli3dof … --device serial://PATH`` opens.
"""

from __future__ import annotations

import argparse
import os
import select
import time
import tty
from collections import deque
from collections.abc import Callable

from .endpoint import Endpoint

SPIN_US = 150
"""µs: the loop polls instead of sleeping where a sample is due within this time"""
IDLE_US = 20_000
"""µs, the longest sleep"""
FULL = 8192
"""Bytes kept for a host that does not read; further replies are dropped"""


def emulated(url: str = "mock:") -> Endpoint:
    """Return the emulated device of a ``mock:`` URL. Raises UsageError for a bad option."""
    from heli3dof.rig.profile import default_profile
    from heli3dof.rig.url import parse_url

    from ..mock import endpoint_of, own_profile
    from ..options import MockOptions

    options = MockOptions.of(parse_url(url))
    return endpoint_of(own_profile(options, default_profile()), options)


class Delay:
    """Queue for one direction of a simulated connection; it delays bytes by ``delay_us`` µs."""

    def __init__(self, delay_us: int = 0) -> None:
        self._delay_us = delay_us
        self._pending: deque[tuple[int, bytes]] = deque()

    def put(self, now_us: int, data: bytes) -> None:
        if data:
            self._pending.append((now_us + self._delay_us, data))

    def get(self, now_us: int) -> bytes:
        """Return the bytes that have arrived by ``now_us`` (µs)."""
        out = b""
        while self._pending and self._pending[0][0] <= now_us:
            out += self._pending.popleft()[1]
        return out

    def next_us(self) -> int | None:
        """Return the time in µs at which the next byte arrives; None if no byte is pending."""
        return self._pending[0][0] if self._pending else None


def serve(
    endpoint: Endpoint,
    fd: int,
    going: Callable[[], bool] = lambda: True,
    *,
    delay_us: int = 0,
) -> None:
    """Run the device at file descriptor ``fd`` until ``going`` returns False or ``fd`` closes.

    ``delay_us``: delay of every byte in each direction, µs.
    """
    os.set_blocking(fd, False)
    start = time.monotonic_ns() // 1000
    waiting = b""
    to_device, to_host = Delay(delay_us), Delay(delay_us)
    while going():
        now = time.monotonic_ns() // 1000 - start
        dues = (endpoint.next_us(), to_device.next_us(), to_host.next_us())
        left = min([IDLE_US, *(due - now for due in dues if due is not None)])
        # Poll at the end: a sleep may overshoot by more than a sample may be late.
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
        to_device.put(now, data)
        arrived = to_device.get(now)
        to_host.put(now, endpoint.receive(now, arrived) if arrived else endpoint.tick(now))
        reply = to_host.get(now)
        if len(waiting) + len(reply) <= FULL:
            waiting += reply
        if waiting:
            try:
                waiting = waiting[os.write(fd, waiting) :]
            except BlockingIOError:
                pass
            except OSError:
                return


def main() -> None:
    parser = argparse.ArgumentParser(description="The emulated rig at a pseudo-terminal.")
    parser.add_argument(
        "--device", default="mock:", help="URL of the emulated rig; see docs/reference/mock.md"
    )
    parser.add_argument("--with-parent", action="store_true", help="end with the parent process")
    parser.add_argument("--delay-ms", type=float, default=0.0, help="delay of every byte, each way")
    options = parser.parse_args()
    endpoint = emulated(options.device)
    descriptor, path = _terminal()
    print(path, flush=True)
    parent = os.getppid()
    serve(
        endpoint,
        descriptor,
        lambda: not options.with_parent or os.getppid() == parent,
        delay_us=round(1e3 * options.delay_ms),
    )


def _terminal() -> tuple[int, str]:
    """Open a raw pseudo-terminal; return the rig's file descriptor and the path for the host.

    This process also keeps the host's end open, so that the rig keeps running after the host closes
    it.
    """
    rig_end, host_end = os.openpty()
    tty.setraw(host_end)
    return rig_end, os.ttyname(host_end)


if __name__ == "__main__":
    main()
