"""The emulated rig as a USB device: descriptors, endpoint 0, and two bulk pipes around the link.

    OUT 0x01 ─▶ Endpoint.receive ─┐
                Endpoint.tick ────┴─▶ IN 0x81          EP 0: standard requests, stop

What a bus does to a device happens here: halted pipes, pipes that answer nothing, lost power.
The clock is the caller's, in whole microseconds; nothing waits. Both doors use it: pyusb's backend
in this process (transport_usb.py) and a real Linux USB stack (tests/kernel_usb).
"""

from __future__ import annotations

import struct
from typing import NamedTuple, Protocol

from ..link.frames import Cause

VENDOR, PRODUCT = 0x1209, 0x0001
CLASS, SUBCLASS, PROTOCOL = 0xFF, 0x48, 0x01
OUT, IN = 0x01, 0x81
PACKET = 512
"""Bytes in a packet of a high-speed bulk pipe"""
FIFO = 8192
"""Bytes that wait for a host that does not read; what comes then is lost, in whole answers"""
STOP = 0x45

DEVICE = struct.pack(
    "<BBHBBBBHHHBBBB", 18, 1, 0x0200, 0, 0, 0, 64, VENDOR, PRODUCT, 0x0100, 1, 2, 3, 1
)
_INTERFACE = struct.pack("<9B", 9, 4, 0, 0, 2, CLASS, SUBCLASS, PROTOCOL, 0)
_PIPES = b"".join(struct.pack("<BBBBHB", 7, 5, pipe, 2, PACKET, 0) for pipe in (OUT, IN))
CONFIGURATION = (
    struct.pack("<BBHBBBBB", 9, 2, 9 + len(_INTERFACE + _PIPES), 1, 1, 0, 0xC0, 0)
    + _INTERFACE
    + _PIPES
)
"""One configuration, fed by its own supply, one interface, two pipes"""


class Link(Protocol):
    """The device's side of the link; `heli3dof_drivers.emulator.endpoint.Endpoint` is one."""

    def receive(self, now_us: int, data: bytes) -> bytes: ...

    def tick(self, now_us: int) -> bytes: ...

    def next_us(self) -> int | None: ...

    def stop(self, now_us: int, cause: Cause = ...) -> bytes: ...


class Setup(NamedTuple):
    """The eight bytes that begin a control transfer."""

    request_type: int
    request: int
    value: int
    where: int
    """wIndex: a pipe or an interface"""
    length: int


class UsbFunction:
    """One device on a bus. Methods that return None answer with a STALL."""

    def __init__(self, link: Link, serial: str, *, configured: bool = True) -> None:
        self.link = link
        self.serial = serial
        self.configuration = int(configured)
        self.halted: set[int] = set()
        """Pipes that stall until the host clears them"""
        self.stuck: set[int] = set()
        """Pipes that stall again when they were cleared"""
        self.silent = False
        """Both pipes answer NAK to everything: transfers time out"""
        self._said = b""

    def setup(self, now_us: int, setup: Setup) -> bytes | None:
        """A control transfer without data towards the device."""
        kind, request = setup.request_type, setup.request
        answer: bytes | None = None
        if (kind, request) == (0x80, 6):
            answer = self._descriptor(setup.value >> 8, setup.value & 0xFF)
        elif (kind, request) == (0x80, 8):
            answer = bytes([self.configuration])
        elif (kind, request) == (0x00, 9) and setup.value in (0, 1):
            if not setup.value:
                self.lost(now_us)
            self.configuration = setup.value
            self.halted.clear()
            answer = b""
        elif request == 0 and kind in (0x80, 0x81):
            answer = bytes([kind == 0x80, 0])
        elif request == 0 and kind == 0x82:
            answer = bytes([setup.where in self.halted | self.stuck, 0])
        elif kind == 0x02 and request in (1, 3) and setup.where in (OUT, IN):
            (self.halted.discard if request == 1 else self.halted.add)(setup.where)
            answer = b""
        elif (kind, request) == (0x01, 11) and setup.value == 0:
            answer = b""
        elif (kind, request) == (0x81, 10):
            answer = b"\0"
        elif (kind, request) == (0x40, STOP):
            self._stop(now_us, setup.value)
            answer = b""
        return None if answer is None else answer[: setup.length]

    def _descriptor(self, kind: int, index: int) -> bytes | None:
        texts = ("", "heli3dof", "emulated 3-DOF helicopter", self.serial)
        if kind == 1:
            return DEVICE
        if kind == 2 and index == 0:
            return CONFIGURATION
        if kind == 3 and index < len(texts):
            body = texts[index].encode("utf-16-le") if index else b"\x09\x04"
            return bytes([2 + len(body), 3]) + body
        return None

    def take(self, now_us: int, data: bytes) -> bool | None:
        """Bytes from the host. False: NAK, try again."""
        if OUT in self.halted | self.stuck:
            return None
        if self.silent or not self.configuration:
            return False
        self._say(self.link.receive(now_us, data))
        return True

    def give(self, now_us: int, longest: int) -> bytes | None:
        """Bytes to the host, b"" for a NAK."""
        self._say(self.link.tick(now_us))
        if IN in self.halted | self.stuck:
            return None
        if self.silent or not self.configuration:
            return b""
        now, self._said = self._said[:longest], self._said[longest:]
        return now

    def next_us(self) -> int | None:
        """When there may be more to give."""
        return self.link.next_us()

    def lost(self, now_us: int) -> None:
        """The bus was reset or taken away, or the configuration was: the motors stop."""
        self._stop(now_us, Cause.SUPPLY)
        self.configuration = 0
        self.halted.clear()
        self._said = b""

    def _stop(self, now_us: int, cause: int) -> None:
        try:
            named = Cause(cause)
        except ValueError:
            named = Cause.HOST_ESTOP
        self._say(self.link.stop(now_us, named))

    def _say(self, data: bytes) -> None:
        if len(self._said) + len(data) <= FIFO:
            self._said += data
