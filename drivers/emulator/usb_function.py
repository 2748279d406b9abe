"""The emulated rig as a USB device: descriptors, two bulk pipes for the link, an emergency stop.

    OUT 0x01 ─▶ Endpoint.receive ─┐
                Endpoint.tick ────┴─▶ IN 0x81

The frames of docs/reference/protocol.md (the link) go through the pipes; the emergency stop is a
request on endpoint 0. This module also simulates bus faults: halted pipes, silent pipes, lost
power. The caller keeps the clock, in whole microseconds; no method waits. Two transports use this
device: pyusb's backend in this process (`transport_usb`) and a real Linux USB stack
(tests/kernel_usb).
"""

from __future__ import annotations

import struct

from ..link.frames import Cause
from .endpoint import Endpoint

VENDOR, PRODUCT = 0x1209, 0x0001
CLASS, SUBCLASS, PROTOCOL = 0xFF, 0x48, 0x01
OUT, IN = 0x01, 0x81
PACKET = 512
"""Bytes in a packet of a high-speed bulk pipe"""
FIFO = 8192
"""Bytes kept for a host that does not read; further replies are dropped whole"""
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
"""One configuration, self-powered, with one interface and two pipes"""


class UsbFunction:
    """Emulated USB device. `control`, `receive` and `send` return None for STALL (an error)."""

    def __init__(self, endpoint: Endpoint, serial: str) -> None:
        self.endpoint = endpoint
        self.serial = serial
        self.configuration = 1
        self.halted: set[int] = set()
        """Pipes that stall until the host clears them"""
        self.stuck: set[int] = set()
        """Pipes that stall again each time the host has cleared them"""
        self.silent = False
        """Both pipes reply NAK to everything: transfers time out"""
        self._to_host = b""

    def control(self, now_us: int, kind: int, request: int, value: int) -> bytes | None:
        """Execute a USB control request: read a string descriptor, or stop the motors.

        Returns the bytes of the string descriptor, or b"" after a stop. The result None means STALL
        (an error): the request is unknown, or there is no such descriptor. ``kind``, ``request``,
        ``value``: bmRequestType, bRequest, wValue; ``now_us``: time in µs.
        """
        if (kind, request, value >> 8) == (0x80, 6, 3):
            return self._string(value & 0xFF)
        if (kind, request) == (0x40, STOP):
            self._stop(now_us, value)
            return b""
        return None

    def configure(self, now_us: int, value: int) -> None:
        """Set the USB configuration at ``now_us`` (µs): 1 (ready), or 0, which stops the motors."""
        if not value:
            self.lost(now_us)
        self.configuration = value
        self.halted.clear()

    def receive(self, now_us: int, data: bytes) -> bool | None:
        """Receive ``data`` from the host at ``now_us`` (µs); return the USB handshake.

        True means ACK: the bytes were accepted. False means NAK: the host must send them again.
        None means STALL: the pipe is halted.
        """
        if OUT in self.halted | self.stuck:
            return None
        if self.silent or not self.configuration:
            return False
        self._send(self.endpoint.receive(now_us, data))
        return True

    def send(self, now_us: int, longest: int) -> bytes | None:
        """Return at most ``longest`` bytes for the host at ``now_us`` (µs).

        An empty result means NAK: there are no bytes yet. None means STALL.
        """
        self._send(self.endpoint.tick(now_us))
        if IN in self.halted | self.stuck:
            return None
        if self.silent or not self.configuration:
            return b""
        now, self._to_host = self._to_host[:longest], self._to_host[longest:]
        return now

    def lost(self, now_us: int) -> None:
        """Stop the motors at ``now_us`` (µs), because the bus was reset or the device unplugged."""
        self._stop(now_us, Cause.SUPPLY)
        self.configuration = 0
        self.halted.clear()
        self._to_host = b""

    def _string(self, index: int) -> bytes | None:
        texts = ("", "heli3dof", "emulated 3-DOF helicopter", self.serial)
        if index >= len(texts):
            return None
        body = texts[index].encode("utf-16-le") if index else b"\x09\x04"
        return bytes([2 + len(body), 3]) + body

    def _stop(self, now_us: int, cause: int) -> None:
        known = Cause(cause) if cause in set(Cause) else Cause.HOST_ESTOP
        self._send(self.endpoint.stop(now_us, known))

    def _send(self, data: bytes) -> None:
        if len(self._to_host) + len(data) <= FIFO:
            self._to_host += data
