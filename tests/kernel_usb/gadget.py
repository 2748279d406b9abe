"""The emulated rig as a CDC-ACM device on the kernel's dummy_hcd: a true /dev/ttyACM0.

    pyserial ── /dev/ttyACM0 ── cdc-acm ── dummy_hcd ── usb_f_acm ── /dev/ttyGS0 ── Endpoint
                                                                              or ── C firmware

configfs describes the device; binding it to the controller plugs it in. The commands ``firmware``
and ``python`` select the device. ``python -m tests.kernel_usb.gadget``: one command per line of
stdin.
"""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
import tty
from pathlib import Path

from heli3dof_drivers.emulator.endpoint import Endpoint

from tests.drivers.emulator.still import StillDevice

CONFIGFS = Path("/sys/kernel/config")
GADGET = CONFIGFS / "usb_gadget/rig"
CONTROLLER = "dummy_udc.0"
PORT = "/dev/ttyGS0"
SERIAL = "G1"
FIRMWARE = Path("/firmware/heli3dof-rig")
"""Present where the host had a C compiler"""


def describe() -> None:
    """A device with one CDC-ACM function and a serial number."""
    if not (CONFIGFS / "usb_gadget").is_dir():
        mount = ["/bin/busybox", "mount", "-t", "configfs", "configfs", str(CONFIGFS)]
        subprocess.run(mount, check=True)
    for folder in ("strings/0x409", "configs/c.1", "functions/acm.usb0"):
        (GADGET / folder).mkdir(parents=True, exist_ok=True)
    (GADGET / "idVendor").write_text("0x1209")
    (GADGET / "idProduct").write_text("0x0002")
    (GADGET / "strings/0x409/serialnumber").write_text(SERIAL)
    (GADGET / "strings/0x409/product").write_text("emulated 3-DOF helicopter")
    (GADGET / "configs/c.1/acm.usb0").symlink_to(GADGET / "functions/acm.usb0")


class Firmware:
    """The device in C, a program at a terminal, instead of an `Endpoint`."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [str(FIRMWARE), "--watchdog", "1000", "--serial", SERIAL],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._process.stdout
        path = self._process.stdout.readline().strip()
        self.terminal = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.terminal)

    def receive(self, now_us: int, data: bytes) -> bytes:
        if data:
            os.write(self.terminal, data)
        try:
            return os.read(self.terminal, 4096)
        except BlockingIOError:
            return b""

    def next_us(self) -> None:
        return None

    def end(self) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self.terminal)


class Server:
    """The device between its port and the commands for its cable."""

    def __init__(self) -> None:
        describe()
        self._start = time.monotonic()
        self._endpoint = Endpoint(StillDevice(watchdog_s=1.0), serial=SERIAL)  # type: ignore[arg-type]
        self._firmware: Firmware | None = None
        self._port: int | None = None
        self._unsent = b""

    def _now_us(self) -> int:
        return int((time.monotonic() - self._start) * 1e6)

    def run(self) -> None:
        """Until stdin ends."""
        while True:
            port = self._port
            ports = [] if port is None else [port]
            if self._firmware:
                ports.append(self._firmware.terminal)
            ready, _, _ = select.select([0, *ports], [], [], self._until())
            if port is not None:
                self._serve(port, port in ready)
            if 0 in ready:
                line = sys.stdin.readline()
                if not line:
                    return
                print(self.command(line.strip()), flush=True)

    def _serve(self, port: int, ready: bool) -> None:
        try:
            data = os.read(port, 4096) if ready else b""
        except BlockingIOError:
            data = b""
        except OSError:  # hung up: the cable is out
            os.close(port)
            self._port, self._unsent = None, b""
            return
        device = self._firmware or self._endpoint
        self._unsent = (self._unsent + device.receive(self._now_us(), data))[-4096:]
        try:
            self._unsent = self._unsent[os.write(port, self._unsent) :] if self._unsent else b""
        except OSError:
            self._unsent = b""

    def _until(self) -> float:
        due = self._endpoint.next_us()
        if due is None:
            return 0.02
        return min(0.02, max(0.0, (due - self._now_us()) / 1e6))

    def command(self, line: str) -> str:
        match line:
            case "plug":
                if not (GADGET / "UDC").read_text().strip():
                    (GADGET / "UDC").write_text(CONTROLLER)
                self._port = os.open(PORT, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
                tty.setraw(self._port)
            case "pull":
                (GADGET / "UDC").write_text("\n")
            case "firmware":
                self._firmware = self._firmware or Firmware()
            case "python":
                if self._firmware:
                    self._firmware.end()
                self._firmware = None
            case "state":
                amplifier = self._endpoint.amplifier
                self._endpoint.tick(self._now_us())
                front, back = amplifier.output_uV(self._now_us())
                return f"{amplifier.flags} {int(amplifier.cause)} {front} {back}"
            case _:
                return f"unknown command {line!r}"
        return "ok"


if __name__ == "__main__":
    Server().run()
