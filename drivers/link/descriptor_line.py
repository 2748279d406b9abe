"""A `Transport` over an open file descriptor: a serial port, a pseudo-terminal or a socket.

Reading returns as soon as bytes arrive. So a round trip takes only a third of the time that it
takes with pyserial's ``read``.
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
    """A connection over an open file descriptor ``fd``, which is made non-blocking.

    ``name`` is the port or URL in messages; `close` calls ``release`` once to close the descriptor.
    """

    def __init__(self, fd: int, name: str, release: Callable[[], None]) -> None:
        os.set_blocking(fd, False)
        self._fd = fd
        self.name = name
        self._release: Callable[[], None] | None = release

    def write(self, data: bytes) -> None:
        """Send all of ``data``. Raises DeviceError if the port is gone or blocks too long."""
        until = time.monotonic() + WRITE_S
        while data:
            try:
                data = data[os.write(self._open_fd(), data) :]
            except BlockingIOError:
                left = until - time.monotonic()
                if left <= 0:
                    raise _full(self.name) from None
                select.select([], [self._fd], [], left)
            except OSError as problem:
                raise gone(self.name, problem) from problem

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived; b"" when none arrive within ``timeout_s`` seconds."""
        fd = self._open_fd()
        try:
            if not select.select([fd], [], [], timeout_s)[0]:
                return b""
            data = os.read(fd, CHUNK)
        except BlockingIOError:
            return b""
        except OSError as problem:
            raise gone(self.name, problem) from problem
        if not data and self._hung_up():
            raise gone(self.name, None)
        return data

    def close(self) -> None:
        release, self._release = self._release, None
        if release is None:
            return
        try:
            release()
        except Exception:
            return  # the line is gone: nothing to release

    def _hung_up(self) -> bool:
        """Return True if the connection is closed.

        Call this after select() reported data but read() returned none. A terminal is closed if
        poll() reports POLLHUP or an error; otherwise another process has read the bytes. Any other
        descriptor without data is closed.
        """
        if not os.isatty(self._fd):
            return True
        poll = select.poll()
        poll.register(self._fd, 0)  # hang-up and error are always reported
        return bool(poll.poll(0))

    def _open_fd(self) -> int:
        if self._release is None:
            raise gone(self.name, None)
        return self._fd


def gone(name: str, problem: Exception | None) -> DeviceError:
    """Return the DeviceError for a lost connection ``name``; ``problem``: the system's error."""
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
