"""Opening what pyserial opens as a `Transport`, and the errors of doing so.

A port with a file descriptor is read straight from it, what else pyserial knows (``loop://``,
``rfc2217://``, ``spy://``) through pyserial.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Callable
from typing import TYPE_CHECKING, TypeVar

from heli3dof.errors import DeviceError, UsageError

from .descriptor_line import WRITE_S, DescriptorLine, gone
from .serial_ports import held_by, permission_fix, usb_ports

if TYPE_CHECKING:
    from serial import Serial

    from .transport import Transport

BAUD = 921_600
T = TypeVar("T")


class PyserialLine:
    """A port whose bytes pyserial itself must carry."""

    def __init__(self, port: Serial, name: str) -> None:
        self._port = port
        self._name = name

    @property
    def name(self) -> str:
        return self._name

    def write(self, data: bytes) -> None:
        """All of ``data``. Raises DeviceError."""
        self._called(lambda: self._port.write(data))

    def read(self, timeout_s: float) -> bytes:
        """What is there; see `Transport.read`."""

        def read() -> bytes:
            port = self._port
            if port.timeout != timeout_s:
                port.timeout = timeout_s
            first = bytes(port.read(max(1, port.in_waiting)))
            return first + bytes(port.read(port.in_waiting)) if first else b""

        return self._called(read)

    def flush_input(self) -> None:
        """Forget what has arrived."""
        self._called(self._port.reset_input_buffer)

    def close(self) -> None:
        try:
            self._port.close()
        except Exception:
            return  # it is gone: nothing is left to be released

    def _called(self, call: Callable[[], T]) -> T:
        from serial import SerialException

        try:
            return call()
        except (SerialException, OSError, TypeError) as problem:
            # TypeError: pyserial's own, of a port that was closed meanwhile.
            raise gone(self._name, problem) from problem


def open_line(url: str, *, baud: int = BAUD, low_latency: bool = True) -> Transport:
    """Open a port or a pyserial URL for this process alone. Raises DeviceError or UsageError."""
    import serial
    from serial.urlhandler import protocol_socket

    try:
        port = serial.serial_for_url(url, do_not_open=True)
    except ValueError as problem:
        raise UsageError(
            f"{url}: pyserial does not open such a place ({problem}).",
            cause="a typing error behind the + of the scheme.",
            fix="serial+socket://host:port, serial+rfc2217://host:port, serial+spy://port",
        ) from problem
    plain = type(port) is serial.Serial
    try:
        port.baudrate = baud
        port.timeout = port.write_timeout = WRITE_S
        if plain and os.name == "posix":  # Windows lets in one program at a time
            port.exclusive = True
        port.open()
    except (serial.SerialException, OSError, ValueError) as problem:
        raise refused(url, problem) from problem
    if low_latency and plain:
        prefer_low_latency(port)
    if os.name == "posix" and (plain or isinstance(port, protocol_socket.Serial)):
        return DescriptorLine(port.fileno(), url, port.close)
    return PyserialLine(port, url)


def prefer_low_latency(port: Serial) -> bool:
    """Ask the port's driver not to hold bytes back; False where it has no such mode."""
    try:
        port.set_low_latency_mode(True)
    except (AttributeError, OSError, ValueError, NotImplementedError):
        return False
    return True


def refused(url: str, problem: Exception) -> DeviceError:
    """Why a port did not open, and what opens it."""
    number = getattr(problem, "errno", None)
    if "://" in url:
        return DeviceError(
            f"{url} does not open: {problem}.",
            cause="nobody listens there, or the name is another.",
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
            cause="a rig is flown by one program at a time.",
            fix=f"end that program; heli3dof estop --device serial://{url} stops the motors now",
        )
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        there = ", ".join(usb_ports()) or "none on USB"
        return DeviceError(
            f"{url}: there is no such port (ports: {there}).",
            cause="the cable is out, or the rig came up under another name.",
            fix="heli3dof devices",
        )
    return DeviceError(
        f"{url} does not open: {problem}.",
        cause="it is no serial port, or its driver hangs.",
        fix="heli3dof devices lists the serial ports",
    )


def pyserial_url(scheme: str, where: str) -> str:
    """What pyserial calls the place of a device URL. Raises UsageError where there is none.

    >>> pyserial_url("serial", "/dev/ttyACM0"), pyserial_url("serial+socket", "host:5000")
    ('/dev/ttyACM0', 'socket://host:5000')
    """
    inner = scheme.partition("+")[2]
    if not where and inner != "loop":
        raise UsageError(
            f"{scheme}: names no port.",
            cause="the place is missing.",
            fix="serial:///dev/ttyACM0; heli3dof devices lists the ports",
        )
    return f"{inner}://{where}" if inner else where
