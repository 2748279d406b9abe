"""An emulated USB bus for tests, with rigs to plug in and the driver on it."""

from __future__ import annotations

import time

from heli3dof_drivers.emulator.transport_usb import BusFault, EmulatedBus, RigOnBus
from heli3dof_drivers.emulator.usb_mock import rig_on_bus
from heli3dof_drivers.options import RigOptions
from heli3dof_drivers.usb_bulk import UsbDriver
from heli3dof_drivers.usb_bulk.rig import UsbRig

from heli3dof.rig.interface import Command, Sample
from heli3dof.rig.profile import default_profile
from heli3dof.rig.url import parse_url

PROFILE = default_profile()


class Lab:
    """A driver and its bus."""

    def __init__(self) -> None:
        self.bus = EmulatedBus([])
        self.driver = UsbDriver(lambda: self.bus)
        self.opened: list[UsbRig] = []

    def plug(self, seed: int = 1, *faults: str) -> RigOnBus:
        """Plug in a rig with serial number mock-SEED; its faults count from now."""
        rig = rig_on_bus(PROFILE, RigOptions(seed=seed, watchdog_s=0.5))
        self.set_faults(rig, *faults)
        self.bus.rigs.append(rig)
        return rig

    def set_faults(self, rig: RigOnBus, *faults: str) -> None:
        """Set a rig's faults; their times count from now."""
        began = self.bus.now_us() / 1e6
        read = [BusFault.of(text) for text in faults]
        rig.faults = [BusFault(f.kind, f.at_s + began, f.for_s) for f in read]

    def open(self, url: str = "usb:") -> UsbRig:
        rig = self.driver.open(parse_url(url), PROFILE)
        assert isinstance(rig, UsbRig)
        self.opened.append(rig)
        return rig

    def close(self) -> None:
        for rig in self.opened:
            rig.close()


def fly(rig: UsbRig, periods: int, volts: float = 5.0) -> list[Sample]:
    """Arm and send the same volts for ``periods`` periods."""
    samples = [rig.arm()]
    start = time.monotonic()
    for k in range(periods):
        due = start + (k + 1) * PROFILE.dt
        samples.append(rig.exchange(Command(k + 1, volts, volts), due))
    return samples
