"""Carries the link's bytes over a pair of USB bulk pipes.

    OUT 0x01   host → device      a transfer may hold several frames or a part of one
    IN  0x81   device → host      a thread keeps one transfer pending and queues its bytes
    EP 0       bmRequestType 0x40, bRequest 0x45, wValue = reason: stop, even if the pipes stall

Reading needs a thread: libusb waits whole milliseconds, too long for a control period of 2 ms. A
stalled pipe is cleared and used again. The checksums and numbers of the frames show which frames
were lost. A pipe that stalls twice without a byte in between ends the connection.
"""

from __future__ import annotations

import errno
import math
import os
import queue
import threading
import time
from array import array
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from heli3dof.errors import DeviceError

from ..errors import closed
from .devices import interface_of
from .errors import explain, explained

OUT, IN = 0x01, 0x81
VENDOR_OUT, STOP = 0x40, 0x45
LONGEST_READ = 4096
"""Bytes; a multiple of every packet size, so every packet fits"""
WRITE_S = 0.25
"""s that the rig may take to accept a frame"""
CONTROL_S = 0.25
"""s that the rig may take to accept a control request"""
READ_S = 0.05
"""s that one IN transfer waits; closing may take as long"""


def _ms(seconds: float) -> int:
    """Return ``seconds`` as a libusb timeout: whole ms, at least 1 (0 would wait for ever)."""
    return max(1, math.ceil(seconds * 1000))


def stop(device: Any, reason: int, name: str, tries: int = 1) -> None:
    """Set zero volts by a control request to ``device``; ``reason`` is a number of `Cause`.

    The request works even if the pipes stall or another process has claimed them. It is repeated
    after a timeout, up to ``tries`` times in all. ``name``: the rig's URL, for messages.
    """
    import usb.core

    with explained(name, "stopping it"):
        for left in reversed(range(tries)):
            try:
                device.ctrl_transfer(VENDOR_OUT, STOP, reason & 0xFFFF, 0, None, _ms(CONTROL_S))
                return
            except usb.core.USBTimeoutError:
                if not left:
                    raise


class UsbTransport:
    """An open pair of USB pipes to one rig; implements `link.request_reply.Transport`."""

    def __init__(
        self, device: Any, name: str, *, write_s: float = WRITE_S,
        holder: Callable[[], str] = lambda: "",
    ) -> None:  # fmt: skip
        """Claim the rig's interface. Raises DeviceError if it is gone, busy or not permitted.

        ``name``: the rig's URL. ``write_s``: time limit in s for the rig to accept a frame.
        ``holder`` returns the name of the process that uses a busy rig.
        """
        self.name = name
        self._device = device
        self._write_s = write_s
        self._open = True
        self.stalls = 0
        """Stalled pipes that were cleared"""
        with explained(name, "opening it", holder):
            _claim(device, name)
        self._received: queue.SimpleQueue[bytes | DeviceError] = queue.SimpleQueue()
        self._ended: DeviceError | None = None
        self._reader = threading.Thread(target=self._read_loop, name=f"{name} in", daemon=True)
        self._reader.start()

    def write(self, data: bytes) -> None:
        """Send all of ``data``; raises DeviceError if the rig does not accept it in time."""
        import usb.core

        self._check_open()
        deadline = time.monotonic() + self._write_s
        stalled = False
        while data:
            try:
                sent = self._device.write(OUT, data, _ms(deadline - time.monotonic()))
            except usb.core.USBError as error:
                self._recover(error, OUT, stalled, "taking a frame")
                stalled, data = True, b"\0" + data  # the delimiter ends a torn frame
                continue
            data = data[sent:]
            if data and time.monotonic() >= deadline:
                timeout = usb.core.USBTimeoutError("timeout", errno=errno.ETIMEDOUT)
                raise explain(timeout, self.name, "taking a frame")

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived; b"" if none arrive within ``timeout_s`` seconds."""
        self._check_open()
        if self._ended is not None:
            raise self._ended
        received, out = self._received, []
        with suppress(queue.Empty):
            item = received.get(timeout=timeout_s) if timeout_s > 0 else received.get_nowait()
            while isinstance(item, bytes):
                out.append(item)
                item = received.get_nowait()
            self._ended = item
        if self._ended is not None and not out:
            raise self._ended
        return b"".join(out)

    def stop(self, reason: int) -> None:
        """Set zero volts now, by a control request; ``reason`` is a number of `Cause`."""
        self._check_open()
        stop(self._device, reason, self.name)

    def follow_scheduling(self) -> None:
        """Give the reading thread the calling thread's scheduling policy and priority.

        A loop under SCHED_FIFO must not wait for a reader with normal scheduling.
        """
        if hasattr(os, "sched_setscheduler") and self._reader.native_id is not None:
            with suppress(OSError):
                policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
                os.sched_setscheduler(self._reader.native_id, policy, priority)

    def close(self) -> None:
        """Release the interface. A second call does nothing; an unplugged rig raises no error."""
        import usb.core
        import usb.util

        if self._open:
            self._open = False
            self._reader.join(10 * READ_S)
            with suppress(usb.core.USBError, NotImplementedError):
                usb.util.dispose_resources(self._device)

    def _read_loop(self) -> None:
        import usb.core

        buffer = array("B", bytes(LONGEST_READ))
        stalled = False
        try:
            while self._open:
                try:
                    n = self._device.read(IN, buffer, _ms(READ_S))
                except usb.core.USBError as error:
                    if error.errno != errno.ETIMEDOUT:
                        self._recover(error, IN, stalled, "sending a sample")
                        stalled = True
                    continue
                if n:  # a transfer without bytes only ends the one before it
                    stalled = False
                    self._received.put(buffer[:n].tobytes())
        except DeviceError as error:
            self._received.put(error)
        except Exception as error:  # `read` must raise whatever ends this thread
            self._received.put(explain(error, self.name, "sending a sample"))

    def _recover(self, error: Any, pipe: int, stalled: bool, doing: str) -> None:
        """If ``error`` is a stall of ``pipe``, clear the stall; else raise a DeviceError.

        ``stalled``: True if this transfer has stalled before; then a stall also raises a
        DeviceError. ``doing``: the operation that failed, as text.
        """
        if error.errno != errno.EPIPE or stalled:
            raise explain(error, self.name, doing) from error
        self.stalls += 1
        with explained(self.name, "clearing a stall"):
            self._device.clear_halt(pipe)

    def _check_open(self) -> None:
        if not self._open:
            raise closed(self.name)


def _claim(device: Any, name: str) -> None:
    import usb.core
    import usb.util

    interface = interface_of(device)
    if interface is None or {e.bEndpointAddress for e in interface} != {OUT, IN}:
        raise DeviceError(
            f"{name} is not a heli3dof rig.",
            cause="it has no interface of class 0xFF/0x48/0x01 with bulk pipes 0x01 and 0x81.",
            fix="heli3dof devices; docs/reference/protocol.md, section USB",
        )
    # A configured rig stays as it is: SET_CONFIGURATION would stop its motors.
    try:
        device.get_active_configuration()
    except usb.core.USBError as error:
        if error.errno is not None:
            raise
        device.set_configuration()
    number = int(interface.bInterfaceNumber)
    with suppress(NotImplementedError):  # only Linux can detach a kernel driver
        if device.is_kernel_driver_active(number):
            device.detach_kernel_driver(number)
    usb.util.claim_interface(device, number)
