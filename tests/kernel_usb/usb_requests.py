"""The standard requests of a kernel to the emulated USB device's endpoint 0 (USB 2.0, 9.4).

pyusb's emulated backend needs none of them: only a real USB stack sends them.
"""

from __future__ import annotations

from typing import NamedTuple

from heli3dof_drivers.emulator.usb_function import CONFIGURATION, DEVICE, IN, OUT, UsbFunction


class Setup(NamedTuple):
    """The eight bytes that begin a control transfer."""

    request_type: int
    request: int
    value: int
    where: int
    """wIndex: a pipe or an interface"""
    length: int


class KernelUsbFunction(UsbFunction):
    def setup(self, now_us: int, setup: Setup) -> bytes | None:
        """A control transfer without data towards the device; None is a STALL."""
        answer = self._standard(now_us, setup)
        if answer is None:
            answer = self.control(now_us, setup.request_type, setup.request, setup.value)
        return None if answer is None else answer[: setup.length]

    def _standard(self, now_us: int, setup: Setup) -> bytes | None:
        kind, request, pipe = setup.request_type, setup.request, setup.where
        match kind, request:
            case 0x80, 6:
                return {0x100: DEVICE, 0x200: CONFIGURATION}.get(setup.value)
            case 0x80, 8:
                return bytes([self.configuration])
            case 0x00, 9 if setup.value in (0, 1):
                self.configure(now_us, setup.value)
                return b""
            case ((0x80 | 0x81), 0):
                return bytes([kind == 0x80, 0])
            case 0x82, 0:
                return bytes([pipe in self.halted | self.stuck, 0])
            case 0x02, (1 | 3) if pipe in (OUT, IN):
                (self.halted.discard if request == 1 else self.halted.add)(pipe)
                return b""
            case 0x01, 11 if setup.value == 0:
                return b""
            case 0x81, 10:
                return b"\0"
        return None
