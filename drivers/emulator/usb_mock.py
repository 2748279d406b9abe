"""``usb+mock:`` — the rig of ``mock:`` on a bus of its own."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

from ..mock import Options, device_of
from .door_usb import EmulatedBus, Fault, Rig
from .endpoint import Endpoint
from .usb_function import UsbFunction

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

OURS = ("stream", "timeout_s", "signs", "fault")
"""Options of the door, not of the rig"""


def bus_of(url: DeviceUrl, profile: Profile) -> EmulatedBus:
    """A bus with the one rig that the URL describes. Raises UsageError for a bad option."""
    kept = {name: values for name, values in url.options.items() if name not in OURS}
    options = Options.of(dataclasses.replace(url, options=kept))
    if options.profile is not None:
        from heli3dof.rig.profile import load_profile

        profile = load_profile(options.profile)
    return EmulatedBus([rig_of(profile, options, url.options.get("fault", ()))])


def rig_of(profile: Profile, options: Options, faults: tuple[str, ...] = ()) -> Rig:
    """One rig to be put on a bus."""
    e, serial = profile.encoder, f"mock-{options.seed}"
    endpoint = Endpoint(
        device_of(profile, options), counts_per_rev=(e.roll, e.pitch, e.yaw), serial=serial
    )
    return Rig(UsbFunction(endpoint, serial), [Fault.of(f) for f in faults])
