"""A `Transport` straight over a file descriptor: a tty, a pseudo-terminal, a socket.

Read as soon as the system says that bytes are there: a round trip costs a third of what it does
through pyserial's own ``read``.
"""

from __future__ import annotations

import os
import select
import time
from collections.abc import Callable

from heli3dof.errors import DeviceError

WRITE_S = 0.1
"""s that a port may refuse to take a frame"""
CHUNK = 4096


class DescriptorLine:
    """An open descriptor, non-blocking from here on; ``release`` closes it."""

    def __init__(self, fd: int, name: str, release: Callable[[], None]) -> None:
        os.set_blocking(fd, False)
        self._fd = fd
        self._name = name
        self._release: Callable[[], None] | None = release

    @property
    def name(self) -> str:
        return self._name

    def write(self, data: bytes) -> None:
        """All of ``data``. Raises DeviceError when the port takes no more, or is gone."""
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
        """What is there; see `Transport.read`."""
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
        """Forget what has arrived."""
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
            return  # it is gone: nothing is left to be released

    def _hung_up(self) -> bool:
        """What it means that bytes were there and none could be read.

        A terminal says so of its own: there, another process that stops the rig may have been
        quicker. Elsewhere it is the end.
        """
        if not os.isatty(self._fd):
            return True
        poll = select.poll()
        poll.register(self._fd, 0)  # hang-up and error are always told
        return bool(poll.poll(0))

    def _open_fd(self) -> int:
        if self._release is None:
            raise gone(self._name, None)
        return self._fd


def gone(name: str, problem: Exception | None) -> DeviceError:
    """The line is no longer there."""
    return DeviceError(
        f"{name} is gone{f' ({problem})' if problem else ''}.",
        cause="the cable is out, or the device has lost its supply; its own watchdog takes the "
        "motors to zero.",
        fix="plug it in again, then heli3dof devices",
    )


def _full(name: str) -> DeviceError:
    return DeviceError(
        f"{name} takes no more bytes.",
        cause="the device does not read what it is sent: it hangs, or flow control holds the line.",
        fix="switch the device off and on; heli3dof doctor",
    )
