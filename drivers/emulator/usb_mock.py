"""Driver of ``usb+mock:?hide=…&seed=…``: the rig of ``mock:`` on an emulated USB bus.

The URL takes the options of ``mock:`` but not ``speed`` (a bus runs in real time), and those of
``usb:``. ``bus=KIND@SECONDS[:FOR_SECONDS]`` adds faults of the bus; see `transport_usb`.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from heli3dof.rig.interface import Check, Rig
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from ..options import RigOptions
    from .transport_usb import RigOnBus


class UsbMockDriver:
    """Opens emulated rigs on an emulated USB bus, through pyusb."""

    scheme = "usb+mock"
    options: Sequence[str] = (
        "profile", "hide", "exercise", "seed", "noise", "noise_s", "vibration_hz", "start",
        "spread", "rate_hz", "watchdog_s", "fault",
        "stream", "signs", "timeout_s", "bus",
    )  # fmt: skip
    """The fields of `UsbMockOptions`, repeated so that `estop` need not import pydantic (slow)"""
    private_to_process = True
    """No other process can reach the rig: see `heli3dof.rig.interface.PrivateToProcess`"""

    def find(self) -> Sequence[str]:
        """Return no URLs: an emulated bus exists only while a process has it open."""
        return []

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Return the emulated rig of ``url``, opened on a bus of its own.

        Raises UsageError for a bad option.
        """
        from ..mock import own_profile
        from ..options import UsbMockOptions
        from ..usb_bulk.driver import open_on
        from .transport_usb import EmulatedBus

        options = UsbMockOptions.of(url)
        rig = rig_on_bus(own_profile(options, profile), options, options.bus)
        return open_on(EmulatedBus([rig]), url, profile, options, where="")

    def estop(self, url: DeviceUrl) -> str:
        """Return a message that there is nothing to stop: no other process can reach this rig."""
        return "an emulated rig exists only in the process that runs it: nothing else to stop"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        return ()


def rig_on_bus(profile: Profile, options: RigOptions, faults: tuple[str, ...] = ()) -> RigOnBus:
    """Return an emulated rig for an `EmulatedBus`; ``faults`` are values of the option ``bus=``."""
    from ..mock import device_of, serial_of
    from .endpoint import Endpoint
    from .transport_usb import BusFault, RigOnBus
    from .usb_function import UsbFunction

    e, serial = profile.encoder, serial_of(options)
    endpoint = Endpoint(
        device_of(profile, options),
        counts_per_rev=(e.roll, e.pitch, e.yaw),
        serial=serial,
        boot=int.from_bytes(os.urandom(4), "little"),
    )
    return RigOnBus(UsbFunction(endpoint, serial), [BusFault.of(text) for text in faults])
