"""A line without hardware: an emulated device in the same process."""

from __future__ import annotations

import time
from collections.abc import Callable

from heli3dof_drivers.emulator.endpoint import Endpoint

from heli3dof.errors import DeviceError


class DirectLine:
    """A `Transport` to an endpoint on this process's clock.

    ``to_device`` and ``to_host`` may change, drop or repeat the bytes.
    """

    name = "direct line"

    def __init__(self, endpoint: Endpoint) -> None:
        self.endpoint = endpoint
        self.to_device: Callable[[bytes], bytes] = lambda data: data
        self.to_host: Callable[[bytes], bytes] = lambda data: data
        self.cut = False
        self.latency_s = 0.0
        """s by which the device's bytes are delayed, as by an FTDI adapter"""
        self.closed = False
        self._start = time.monotonic()
        self._waiting = b""
        self._held: list[tuple[float, bytes]] = []

    @property
    def now_us(self) -> int:
        return int((time.monotonic() - self._start) * 1e6)

    def restart(self, endpoint: Endpoint) -> None:
        """Replace the device by another one whose clock begins at zero."""
        self.endpoint = endpoint
        self._start = time.monotonic()

    def write(self, data: bytes) -> None:
        self._check()
        self._carry(self.endpoint.receive(self.now_us, self.to_device(data)))

    def read(self, timeout_s: float) -> bytes:
        self._check()
        until = time.monotonic() + timeout_s
        while True:
            self._carry(self.endpoint.tick(self.now_us))
            if self._waiting or (left := until - time.monotonic()) <= 0:
                data, self._waiting = self._waiting, b""
                return data
            time.sleep(min(left, 2e-4))

    def _carry(self, data: bytes) -> None:
        now = time.monotonic()
        self._held.append((now + self.latency_s, self.to_host(data)))
        while self._held and self._held[0][0] <= now:
            self._waiting += self._held.pop(0)[1]

    def close(self) -> None:
        self.closed = True

    def _check(self) -> None:
        if self.cut:
            raise DeviceError("direct line: unplugged")
