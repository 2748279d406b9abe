"""Driver of ``usb+mock:?hide=…&seed=…``: the rig of ``mock:`` on an emulated USB bus.

The URL accepts all options of ``usb:``. It also accepts the options of ``mock:`` except ``speed``,
because an emulated bus always runs in real time. A further option adds a fault of the bus:
``bus=KIND@SECONDS[:FOR_SECONDS]`` (see `transport_usb`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..mock import MockDriver, endpoint_of, own_profile, serial_of

if TYPE_CHECKING:
    from heli3dof.rig.interface import Rig
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from ..options import RigOptions
    from .transport_usb import RigOnBus


class UsbMockDriver(MockDriver):
    """Opens emulated rigs on an emulated USB bus, through pyusb."""

    scheme = "usb+mock"
    options: Sequence[str] = (
        *(name for name in MockDriver.options if name != "speed"),
        "stream", "signs", "timeout_s", "bus",
    )  # fmt: skip
    """The fields of `UsbMockOptions`, repeated so that `estop` need not import pydantic (slow)"""

    def find(self) -> Sequence[str]:
        """Return no URLs: an emulated bus exists only while a process has it open."""
        return []

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Return the emulated rig of ``url``, opened on a bus of its own.

        Raises UsageError for a bad option.
        """
        from ..options import UsbMockOptions
        from ..usb_bulk.driver import open_on
        from .transport_usb import EmulatedBus

        options = UsbMockOptions.of(url)
        rig = rig_on_bus(own_profile(options, profile), options, options.bus)
        return open_on(EmulatedBus([rig]), url, profile, options, where="")


def rig_on_bus(profile: Profile, options: RigOptions, faults: tuple[str, ...] = ()) -> RigOnBus:
    """Return an emulated rig for an `EmulatedBus`; ``faults`` are values of the option ``bus=``."""
    from .transport_usb import BusFault, RigOnBus
    from .usb_function import UsbFunction

    function = UsbFunction(endpoint_of(profile, options), serial_of(options))
    return RigOnBus(function, [BusFault.of(text) for text in faults])
