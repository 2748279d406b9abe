"""A `Transport` over a file descriptor: a tty, a pseudo-terminal, a socket.

It reads as soon as the system reports bytes: a round trip takes a third of the time that it takes
with pyserial's ``read``.
"""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable

from heli3dof.errors import DeviceError

WRITE_S = 0.1
"""s, the longest wait until the port accepts a frame"""
CHUNK = 4096
"""Bytes of one read at most"""


class DescriptorLine:
    """A line over an open descriptor, made non-blocking; ``release`` is called to close it."""

    def __init__(self, fd: int, name: str, release: Callable[[], None]) -> None:
        os.set_blocking(fd, False)
        self._fd = fd
        self._name = name
        self._release: Callable[[], None] | None = release

    @property
    def name(self) -> str:
        return self._name

    def write(self, data: bytes) -> None:
        """Send all of ``data``. Raises DeviceError if the port is gone or full for `WRITE_S`."""
        until = time.monotonic() + WRITE_S
        while data:
            try:
                data = data[os.write(self._open_fd(), data) :]
            except BlockingIOError:
                left = until - time.monotonic()
                if left <= 0:
                    raise _full(self._name) from None
                select.select([], [self._fd], [], left)
            except OSError as problem:
                raise gone(self._name, problem) from problem

    def read(self, timeout_s: float) -> bytes:
        """Returns the bytes that have arrived; see `Transport.read`."""
        fd = self._open_fd()
        try:
            if not select.select([fd], [], [], timeout_s)[0]:
                return b""
            data = os.read(fd, CHUNK)
        except BlockingIOError:
            return b""
        except OSError as problem:
            raise gone(self._name, problem) from problem
        if not data and self._hung_up():
            raise gone(self._name, None)
        return data

    def flush_input(self) -> None:
        """Discard the bytes that have arrived."""
        for _ in range(64):
            if not self.read(0.0):
                return

    def close(self) -> None:
        release, self._release = self._release, None
        if release is None:
            return
        try:
            release()
        except Exception:
            return  # the line is gone: nothing to release

    def _hung_up(self) -> bool:
        """True if a line that was readable but gave no bytes has ended.

        On a terminal, poll then reports a hang-up. Otherwise another process, such as heli3dof
        estop, has read the bytes first. Any other descriptor has always ended.
        """
        if not os.isatty(self._fd):
            return True
        poll = select.poll()
        poll.register(self._fd, 0)  # hang-up and error are always reported
        return bool(poll.poll(0))

    def _open_fd(self) -> int:
        if self._release is None:
            raise gone(self._name, None)
        return self._fd


def gone(name: str, problem: Exception | None) -> DeviceError:
    """Returns the error for an unplugged line; ``problem``: the system's error, if any."""
    return DeviceError(
        f"{name} is gone{f' ({problem})' if problem else ''}.",
        cause="the cable is out, or the device has lost its supply; its own watchdog takes the "
        "motors to zero.",
        fix="plug it in again; heli3dof devices lists it",
    )


def _full(name: str) -> DeviceError:
    return DeviceError(
        f"{name} accepts no more bytes.",
        cause="the device does not read: it hangs, or flow control holds the line.",
        fix="switch the device off and on; heli3dof doctor",
    )
