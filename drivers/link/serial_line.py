"""Opens a serial port or a pyserial URL as a `Transport`; explains why a port does not open.

A port with a file descriptor is read from the descriptor. Other pyserial URLs (``loop://``,
``rfc2217://``, ``spy://``) are read through pyserial.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar
from urllib.parse import urlencode

from heli3dof.errors import DeviceError, UsageError, quoted

from .descriptor_line import WRITE_S, DescriptorLine, gone
from .serial_ports import held_by, permission_fix, usb_ports

if TYPE_CHECKING:
    from serial import Serial

    from heli3dof.rig.url import DeviceUrl

    from .request_reply import Transport

BAUD = 921_600
PASSED_ON = ("file", "all", "raw", "color", "logging", "timeout", "ign_set_control", "poll_modem")
"""Options of pyserial's own URLs"""
T = TypeVar("T")


class PyserialLine:
    """A connection that is read and written through pyserial."""

    def __init__(self, port: Serial, name: str) -> None:
        self._port = port
        self.name = name

    def write(self, data: bytes) -> None:
        """Send all of ``data``. Raises DeviceError if the port is gone or closed."""
        self._called(lambda: self._port.write(data))

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived; b"" when none arrive within ``timeout_s`` seconds."""

        def read() -> bytes:
            port = self._port
            if port.timeout != timeout_s:
                port.timeout = timeout_s
            first = bytes(port.read(max(1, port.in_waiting)))
            return first + bytes(port.read(port.in_waiting)) if first else b""

        return self._called(read)

    def close(self) -> None:
        try:
            self._port.close()
        except Exception:
            return  # the port is gone: nothing to release

    def _called(self, call: Callable[[], T]) -> T:
        from serial import SerialException

        try:
            return call()
        except (SerialException, OSError, TypeError) as problem:
            # pyserial raises TypeError for a port that was closed meanwhile.
            raise gone(self.name, problem) from problem


def open_line(url: str, *, baud: int = BAUD, low_latency: bool = True) -> Transport:
    """Open a port or pyserial URL, locked against other programs, at ``baud`` bits per second.

    ``low_latency``: ask the port's driver to deliver received bytes without delay. Raises
    DeviceError if the port does not open, UsageError for a URL that pyserial does not know.
    """
    import serial
    from serial.urlhandler import protocol_socket

    try:
        port = serial.serial_for_url(url, do_not_open=True)
    except ValueError as problem:
        raise UsageError(
            f"{url}: pyserial cannot open this URL ({problem}).",
            cause="a typing error after the + of the scheme.",
            fix="serial+socket://host:port, serial+rfc2217://host:port, serial+spy://port",
        ) from problem
    plain = type(port) is serial.Serial
    try:
        port.baudrate = baud
        port.timeout = port.write_timeout = WRITE_S
        if plain and os.name == "posix":  # Windows opens every port exclusively
            port.exclusive = True
        port.open()
    except (serial.SerialException, OSError, ValueError) as problem:
        raise refused(url, problem) from problem
    if low_latency and plain:
        prefer_low_latency(port)
    if os.name == "posix" and (plain or isinstance(port, protocol_socket.Serial)):
        return DescriptorLine(port.fileno(), url, port.close)
    return PyserialLine(port, url)


def open_shared(path: str) -> Transport | None:
    """Open the port ``path`` for a stop, although another process has locked it.

    Returns None on Windows and if no process has locked the port. The port keeps the settings of
    the other process. Raises DeviceError if the port is missing or not permitted.
    """
    if os.name != "posix":
        return None
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as problem:
        raise refused(path, problem) from problem
    if _is_locked(fd):
        return DescriptorLine(fd, path, lambda: os.close(fd))
    os.close(fd)
    return None


def _is_locked(fd: int) -> bool:
    import fcntl

    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False


def prefer_low_latency(port: Serial) -> bool:
    """Ask the driver of ``port`` to deliver bytes without delay; return False if it refuses."""
    try:
        port.set_low_latency_mode(True)
    except (AttributeError, OSError, ValueError, NotImplementedError):
        return False
    return True


def refused(url: str, problem: Exception) -> DeviceError:
    """Return the DeviceError for a port that did not open: the cause and what to do.

    ``problem`` is the exception that opening ``url`` raised.
    """
    number = getattr(problem, "errno", None)
    if "://" in url:
        return DeviceError(
            f"{url} does not open: {problem}.",
            cause="no program listens at this address, or the name is wrong.",
            fix="check host and port; heli3dof devices lists the local ones",
        )
    if number in (errno.EACCES, errno.EPERM):
        return DeviceError(
            f"{url}: not permitted.",
            cause="your user may not open this port.",
            fix=permission_fix(url),
        )
    if number in (errno.EBUSY, errno.EAGAIN):
        return DeviceError(
            f"{url} is busy: {held_by(url)} holds it.",
            cause="one program at a time may run a rig.",
            fix=f"end that program; heli3dof estop --device {quoted(f'serial://{url}')} "
            "stops the motors now",
        )
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        there = ", ".join(usb_ports()) or "none on USB"
        return DeviceError(
            f"{url}: there is no such port (ports: {there}).",
            cause="the cable is out, or the rig has another port name now.",
            fix="heli3dof devices",
        )
    return DeviceError(
        f"{url} does not open: {problem}.",
        cause="it is not a serial port, or its driver hangs.",
        fix="heli3dof devices lists the serial ports",
    )


def pyserial_url(url: DeviceUrl) -> str:
    """Return the port or address of a device URL in pyserial's notation.

    Raises UsageError for a URL without a port, and for a plain port with an option that only
    pyserial's own URLs have.

    >>> from heli3dof.rig.url import parse_url
    >>> pyserial_url(parse_url("serial+spy:///dev/ttyACM0?file=bytes.txt&baud=9600"))
    'spy:///dev/ttyACM0?file=bytes.txt'
    """
    inner = url.scheme.partition("+")[2]
    if not url.where and inner != "loop":
        raise UsageError(
            f"{url.scheme}: names no port.",
            cause="the place is missing.",
            fix="serial:///dev/ttyACM0; heli3dof devices lists the ports",
        )
    query = urlencode([(name, v) for name in PASSED_ON for v in url.options.get(name, ())])
    if query and not inner:
        raise UsageError(
            f"{url.text}: {query.partition('=')[0]} is an option of pyserial's own URLs.",
            cause="a plain port has no such option.",
            fix=f"serial+spy://{url.where}?{query}",
        )
    place = f"{inner}://{url.where}" if inner else url.where
    return f"{place}?{query}" if query else place
