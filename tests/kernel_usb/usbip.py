"""The emulated rig on the kernel's vhci-hcd, a USB host controller with a socket as its cable.

    kernel ── CMD_SUBMIT (setup or data) ──▶ this process ── UsbFunction ── Endpoint
           ◀── RET_SUBMIT (status, data) ──
           ── CMD_UNLINK ──▶ ◀── RET_UNLINK        a transfer that timed out is taken back

Messages are 48 bytes, big-endian, then data (Documentation/usb/usbip_protocol.rst). A transfer to
which the device replies NAK waits here. ``python -m tests.kernel_usb.usbip``: one command per line
of stdin; it replies ``ok`` or a value.
"""

from __future__ import annotations

import select
import socket
import struct
import sys
import time
from dataclasses import dataclass
from pathlib import Path

from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.emulator.usb_function import IN, OUT

from tests.drivers.emulator.still import StillDevice

from .usb_requests import KernelUsbFunction, Setup

VHCI = Path("/sys/devices/platform/vhci_hcd.0")
HIGH_SPEED, DEVICE_ID = 3, 0x00010002
SUBMIT, UNLINK, RET_SUBMIT, RET_UNLINK = 1, 2, 3, 4
EPIPE, ECONNRESET = 32, 104
_BASIC = struct.Struct(">IIIII")
_SUBMIT = struct.Struct(">IiiiiBBHHH")
SERIAL = "K1"


@dataclass
class Waiting:
    """A transfer that the device has not accepted yet."""

    number: int
    towards_device: bool
    length: int
    data: bytes


class Cable:
    """One connection, from attach to unplugging."""

    def __init__(self, function: KernelUsbFunction, port: int = 0) -> None:
        self._function = function
        self._waiting: list[Waiting] = []
        kernels, self.socket = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        line = f"{port} {kernels.fileno()} {DEVICE_ID} {HIGH_SPEED}"
        (VHCI / "attach").write_text(line)
        kernels.close()  # the kernel has its own reference

    def receive(self, now_us: int) -> bool:
        """One message. False: the kernel has hung up."""
        head = self._exactly(48)
        if head is None:
            return False
        command, number, _, direction, pipe = _BASIC.unpack_from(head)
        if command == UNLINK:
            (victim,) = struct.unpack_from(">I", head, _BASIC.size)
            before = len(self._waiting)
            self._waiting = [w for w in self._waiting if w.number != victim]
            status = -ECONNRESET if len(self._waiting) < before else 0
            self._send(_BASIC.pack(RET_UNLINK, number, 0, 0, 0) + struct.pack(">i24x", status))
            return True
        _, length, _, _, _, *setup = _SUBMIT.unpack_from(head, _BASIC.size)
        # The setup's 16-bit fields are little-endian, as on the bus.
        kind, request, *words = setup
        value, where, count = (int.from_bytes(w.to_bytes(2, "big"), "little") for w in words)
        data = b"" if direction else self._exactly(length)
        if data is None:
            return False
        if pipe == 0:
            answer = self._function.setup(now_us, Setup(kind, request, value, where, count))
            self._answer(number, answer)
        else:
            self._waiting.append(Waiting(number, not direction, length, data))
        return True

    def serve(self, now_us: int) -> None:
        """Complete every waiting transfer that the device accepts or stalls now."""
        # First the host's data: the device may reply to it.
        for waiting in sorted(self._waiting, key=lambda w: not w.towards_device):
            if waiting.towards_device:
                taken = self._function.receive(now_us, waiting.data)
                if taken is False:
                    continue
                self._waiting.remove(waiting)
                self._answer(waiting.number, b"" if taken else None, len(waiting.data))
            else:
                given = self._function.send(now_us, waiting.length)
                if given == b"":
                    continue
                self._waiting.remove(waiting)
                self._answer(waiting.number, given)

    @property
    def waits_for_device(self) -> bool:
        return any(not w.towards_device for w in self._waiting)

    def _answer(self, number: int, data: bytes | None, actual: int | None = None) -> None:
        """None: a stall."""
        status = -EPIPE if data is None else 0
        length = 0 if data is None else len(data) if actual is None else actual
        head = _BASIC.pack(RET_SUBMIT, number, 0, 0, 0)
        self._send(head + struct.pack(">iiiii8x", status, length, 0, 0, 0) + (data or b""))

    def _send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def _exactly(self, count: int) -> bytes | None:
        data = b""
        while len(data) < count:
            try:
                more = self.socket.recv(count - len(data))
            except ConnectionError:
                return None
            if not more:
                return None
            data += more
        return data


class Server:
    """The device, its cable, and the commands for both."""

    def __init__(self) -> None:
        self._start = time.monotonic()
        self._endpoint = Endpoint(StillDevice(watchdog_s=1.0), serial=SERIAL)  # type: ignore[arg-type]
        self._function = KernelUsbFunction(self._endpoint, SERIAL, configured=False)
        self._cable: Cable | None = None

    def _now_us(self) -> int:
        return int((time.monotonic() - self._start) * 1e6)

    def run(self) -> None:
        """Until stdin ends."""
        while True:
            cable = self._cable
            ready, _, _ = select.select(
                [0, *([cable.socket] if cable else [])], [], [], self._until()
            )
            if cable and cable.socket in ready and not cable.receive(self._now_us()):
                self._pull()
            elif cable and self._cable:
                cable.serve(self._now_us())
            if 0 in ready:
                line = sys.stdin.readline()
                if not line:
                    return
                print(self.command(line.strip()), flush=True)

    def _until(self) -> float:
        due = self._endpoint.next_us()
        if due is None or self._cable is None or not self._cable.waits_for_device:
            return 0.02
        return min(0.02, max(0.0, (due - self._now_us()) / 1e6))

    def _pull(self) -> None:
        if self._cable:
            self._cable.socket.close()
            self._cable = None
            self._function.lost(self._now_us())

    def command(self, line: str) -> str:
        function = self._function
        match line.split():
            case ["plug"]:
                self._cable = self._cable or Cable(function)
            case ["pull"]:
                self._pull()
            case ["stall", pipe]:
                function.halted.add(OUT if pipe == "out" else IN)
            case ["stick", pipe]:
                function.stuck.add(OUT if pipe == "out" else IN)
            case ["unstick"]:
                function.stuck.clear()
            case ["silent", on]:
                function.silent = on == "1"
            case ["state"]:
                amplifier = self._endpoint.amplifier
                self._endpoint.tick(self._now_us())
                front, back = amplifier.output_uV(self._now_us())
                return f"{amplifier.flags} {int(amplifier.cause)} {front} {back}"
            case _:
                return f"unknown command {line!r}"
        return "ok"


if __name__ == "__main__":
    Server().run()
