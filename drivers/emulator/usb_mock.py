"""``usb+mock:?hide=…&seed=…`` — the rig of ``mock:`` on a USB of its own, without libusb.

It takes every option of ``mock:`` but ``speed`` (a bus is real time), those of ``usb:``, and
``bus=KIND@SECONDS[:FOR_SECONDS]`` for what befalls the bus; see `door_usb`.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..mock import OPTIONS as MOCK_OPTIONS
from ..mock import Options, device_of
from ..usb_bulk.driver import OPTIONS as USB_OPTIONS
from ..usb_bulk.driver import open_on

if TYPE_CHECKING:
    from heli3dof.rig.interface import Check
    from heli3dof.rig.interface import Rig as PortRig
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from .transport_usb import Rig

OF_THE_RIG = tuple(name for name in MOCK_OPTIONS if name != "speed")


class UsbMockDriver:
    """Opens emulated rigs through pyusb."""

    scheme = "usb+mock"
    private_to_process = True
    """See `heli3dof.rig.interface.PrivateToProcess`."""
    options: Sequence[str] = tuple(dict.fromkeys((*OF_THE_RIG, *USB_OPTIONS, "bus")))

    def find(self) -> Sequence[str]:
        """None: what is emulated is there only for whoever asks for it."""
        return []

    def open(self, url: DeviceUrl, profile: Profile) -> PortRig:
        """A bus with the one rig that the URL describes. Raises UsageError for a bad option."""
        from .transport_usb import EmulatedBus

        url.check_options(self.options)
        kept = {name: values for name, values in url.options.items() if name in OF_THE_RIG}
        options = Options.of(dataclasses.replace(url, options=kept))
        emulated = profile
        if options.profile is not None:
            from heli3dof.rig.profile import load_profile

            emulated = load_profile(options.profile)
        bus = EmulatedBus([rig_of(emulated, options, url.options.get("bus", ()))])
        return open_on(bus, url, profile, where="")

    def estop(self, url: DeviceUrl) -> str:
        """There is no rig outside the process that emulates it."""
        return "an emulated rig lives in the process that flies it: nothing else holds one"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        return ()


def rig_of(profile: Profile, options: Options, befalls: tuple[str, ...] = ()) -> Rig:
    """One rig to be put on a bus."""
    from .endpoint import Endpoint
    from .transport_usb import BusFault, Rig
    from .usb_function import UsbFunction

    e, serial = profile.encoder, f"mock-{options.seed}"
    endpoint = Endpoint(
        device_of(profile, options),
        counts_per_rev=(e.roll, e.pitch, e.yaw),
        serial=serial,
        boot=int.from_bytes(os.urandom(4), "little"),
    )
    return Rig(UsbFunction(endpoint, serial), [BusFault.of(b) for b in befalls])
