"""The link's bytes over a USB bulk pipe.

    OUT 0x01   host → device      any cut: a transfer may hold several frames or a part of one
    IN  0x81   device → host      a thread keeps one transfer waiting; what comes is queued
    EP 0       bmRequestType 0x40, bRequest 0x45, wValue = reason: stop, whatever the pipes do

Why a thread: libusb waits whole milliseconds at least, and to look whether something has come must
cost nothing in a loop of 2 ms. A stalled pipe is cleared and used again; what was on its way is
lost, and the link's checks and numbers deal with that. A pipe that stalls twice without a byte in
between ends the connection.
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

from .devices import interface_of
from .errors import explain, explained

OUT, IN = 0x01, 0x81
VENDOR_OUT, STOP = 0x40, 0x45
LONGEST_READ = 4096
"""Bytes; a multiple of every packet size, so that no packet is ever too long for what is left"""
WRITE_S = 0.25
"""s that the rig may take to accept a frame"""
CONTROL_S = 0.25
READ_S = 0.05
"""s that one IN transfer waits: how long closing may take"""


def _ms(seconds: float) -> int:
    """libusb's timeouts are whole milliseconds, and 0 is for ever."""
    return max(1, math.ceil(seconds * 1000))


def stop(device: Any, reason: int, name: str, tries: int = 1) -> None:
    """Zero volts by a control request: needs no claim, and works while the pipes are stalled.

    It may be sent again, and is, up to ``tries`` times, where the bus or the rig was too busy.
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
    """An open pipe to one rig; see `heli3dof_drivers.link.transport.Transport`."""

    def __init__(
        self, device: Any, name: str, *, write_s: float = WRITE_S,
        holder: Callable[[], str] = lambda: "",
    ) -> None:  # fmt: skip
        """Claim the rig's interface. Raises DeviceError (gone, busy, not permitted)."""
        self._name = name
        self._device = device
        self._write_s = write_s
        self._open = True
        self.stalls = 0
        """Pipes that were found stalled and cleared"""
        with explained(name, "opening it", holder):
            _claim(device, name)
        self._came: queue.SimpleQueue[bytes | DeviceError] = queue.SimpleQueue()
        self._ended: DeviceError | None = None
        self._reader = threading.Thread(target=self._listen, name=f"{name} in", daemon=True)
        self._reader.start()

    @property
    def name(self) -> str:
        return self._name

    def write(self, data: bytes) -> None:
        """All of it, or a DeviceError."""
        import usb.core

        self._check_open()
        deadline = time.monotonic() + self._write_s
        stalled = False
        while data:
            try:
                sent = self._device.write(OUT, data, _ms(deadline - time.monotonic()))
            except usb.core.USBError as error:
                self._recover(error, OUT, stalled, "taking a frame")
                stalled, data = True, b"\0" + data  # whatever was torn ends there
                continue
            data = data[sent:]
            if data and time.monotonic() >= deadline:
                late = usb.core.USBTimeoutError("timeout", errno=errno.ETIMEDOUT)
                raise explain(late, self._name, "taking a frame")

    def read(self, timeout_s: float) -> bytes:
        """What is there, at least one byte; b"" when nothing came within ``timeout_s``."""
        self._check_open()
        if self._ended is not None:
            raise self._ended
        came, out = self._came, []
        with suppress(queue.Empty):
            item = came.get(timeout=timeout_s) if timeout_s > 0 else came.get_nowait()
            while isinstance(item, bytes):
                out.append(item)
                item = came.get_nowait()
            self._ended = item
        if self._ended is not None and not out:
            raise self._ended
        return b"".join(out)

    def flush_input(self) -> None:
        """Forget what has come until now."""
        with suppress(queue.Empty):
            while True:
                item = self._came.get_nowait()
                if isinstance(item, DeviceError):
                    self._ended = item

    def stop(self, reason: int) -> None:
        """Zero volts now, past the pipes. The rig does not answer this on the pipe."""
        self._check_open()
        stop(self._device, reason, self._name)

    def follow_scheduling(self) -> None:
        """Give the listening thread the calling thread's policy and priority, where there are any.

        A loop under SCHED_FIFO must not wait for a listener that is scheduled like everybody.
        """
        if hasattr(os, "sched_setscheduler") and self._reader.native_id is not None:
            with suppress(OSError):
                policy, priority = os.sched_getscheduler(0), os.sched_getparam(0)
                os.sched_setscheduler(self._reader.native_id, policy, priority)

    def close(self) -> None:
        """Release the interface; idempotent, and silent where the rig is gone."""
        import usb.core
        import usb.util

        if self._open:
            self._open = False
            self._reader.join(10 * READ_S)
            with suppress(usb.core.USBError, NotImplementedError):
                usb.util.dispose_resources(self._device)

    def _listen(self) -> None:
        """The thread: one IN transfer after the other, until closed or until the bus fails."""
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
                if n:  # a transfer without bytes only ends another
                    stalled = False
                    self._came.put(buffer[:n].tobytes())
        except DeviceError as error:
            self._came.put(error)
        except Exception as error:  # nothing may end this thread without the loop being told
            self._came.put(explain(error, self._name, "sending a sample"))

    def _recover(self, error: Any, pipe: int, stalled: bool, doing: str) -> None:
        """Clear a stall, once; raise everything else."""
        if error.errno != errno.EPIPE or stalled:
            raise explain(error, self._name, doing) from error
        self.stalls += 1
        with explained(self._name, "clearing a stall"):
            self._device.clear_halt(pipe)

    def _check_open(self) -> None:
        if not self._open:
            raise DeviceError(
                f"{self._name} is closed.",
                cause="close() was called before this.",
                fix="open it again with heli3dof.open_rig",
            )


def _claim(device: Any, name: str) -> None:
    """Take the rig's interface; usb.core.USBError where that cannot be."""
    import usb.core
    import usb.util

    interface = interface_of(device)
    if interface is None or {e.bEndpointAddress for e in interface} != {OUT, IN}:
        raise DeviceError(
            f"{name} is not a heli3dof rig.",
            cause="it has no interface of class 0xFF/0x48/0x01 with bulk pipes 0x01 and 0x81.",
            fix="heli3dof devices; docs/reference/protocol.md, section USB",
        )
    # A rig that is configured already is left alone: SET_CONFIGURATION would stop its motors.
    try:
        device.get_active_configuration()
    except usb.core.USBError as error:
        if error.errno is not None:
            raise
        device.set_configuration()
    number = int(interface.bInterfaceNumber)
    with suppress(NotImplementedError):  # only Linux has drivers to be detached
        if device.is_kernel_driver_active(number):
            device.detach_kernel_driver(number)
    usb.util.claim_interface(device, number)
