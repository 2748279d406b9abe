"""Emulated rigs in their own processes, at pseudo-terminals."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from tests.drivers.firmware.building import rig_program


class RigProcess:
    """A rig's process and the path of its terminal."""

    def __init__(self, command: list[str]) -> None:
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        self.path = self.process.stdout.readline().strip()
        if not self.path:
            raise RuntimeError(f"{command[0]} did not open a terminal")

    def url(self, options: str = "") -> str:
        return f"serial://{self.path}" + (f"?{options}" if options else "")

    def end(self) -> None:
        self.process.kill()
        self.process.wait()


@contextmanager
def emulated_rig(device: str = "mock:?watchdog_s=0.3") -> Iterator[RigProcess]:
    """The emulated rig in Python."""
    module = "heli3dof_drivers.emulator.transport_pty"
    rig = RigProcess([sys.executable, "-m", module, "--device", device, "--with-parent"])
    try:
        yield rig
    finally:
        rig.end()


@contextmanager
def firmware_rig(*options: str) -> Iterator[RigProcess]:
    """The firmware in C as a program with its own plant; skips where there is no C compiler."""
    rig = RigProcess([rig_program(), "--with-parent", "--watchdog", "300", *options])
    try:
        yield rig
    finally:
        rig.end()
