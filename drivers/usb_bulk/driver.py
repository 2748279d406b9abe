"""``usb://VID:PID/SERIAL`` — a rig on a USB bulk pipe.

Either part of the place may be left out where one rig fits. Options: ``stream=0`` asks for every
sample instead of letting the rig time them; ``watchdog_s`` is the silence after which the rig
stops itself; ``timeout_s`` is how long it may take to accept a frame; ``signs=profile`` believes
the profile which way the encoders count.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.interface import Check

from .devices import kernel_lists_one, on_bus, select, system_backend

if TYPE_CHECKING:
    from heli3dof.rig.interface import Rig
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

OPTIONS = ("stream", "watchdog_s", "timeout_s", "signs")
STOP_TRIES = 8
"""Of a quarter of a second: without the pipes there is no other way to the rig"""


class UsbDriver:
    """Opens rigs on the USB. ``backend``: pyusb's, the system's libusb unless given."""

    scheme = "usb"
    options: Sequence[str] = OPTIONS

    def __init__(self, backend: Callable[[], Any] = system_backend) -> None:
        self._backend = backend

    def find(self) -> Sequence[str]:
        """The rigs that are plugged in; none where there is no libusb."""
        if self._backend is system_backend and not kernel_lists_one():
            return []
        import usb.core

        try:
            return [rig.url for rig in on_bus(self._backend())]
        except (DeviceError, usb.core.USBError):
            return []

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Claim the rig and speak to it. Raises DeviceError or UsageError, each with its cause."""
        url.check_options(OPTIONS)
        return open_on(self._backend(), url, profile)

    def estop(self, url: DeviceUrl) -> str:
        """Zero volts by a control request, though another process may hold the rig's pipes."""
        import usb.util

        from ..link.frames import Cause
        from .transport import stop

        on = select(self._backend(), url.text, url.where)
        stop(on.device, Cause.HOST_ESTOP, url.text, STOP_TRIES)
        with suppress(Exception):
            usb.util.dispose_resources(on.device)
        return f"{on.url} confirmed the stop; its volts are zero until it is armed again"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """libusb, the udev rule, whether the rig is there, may be opened and is free."""
        from .doctor_checks import examine

        return examine(self._backend, url)


def open_on(bus: Any, url: DeviceUrl, profile: Profile, where: str | None = None) -> Rig:
    """Open a rig on a bus that pyusb reaches through the backend ``bus``; `OPTIONS` of the URL."""
    from .rig import UsbRig
    from .transport import UsbTransport

    watchdog_s = _seconds(url, "watchdog_s", 1.0) if url.one("watchdog_s") else None
    timeout_s = _seconds(url, "timeout_s", 10.0) if url.one("timeout_s") else 0.25
    stream = _choice(url, "stream", ("1", "0")) == "1"
    signs = _choice(url, "signs", ("device", "profile"))
    on = select(bus, url.text, url.where if where is None else where)
    transport = UsbTransport(on.device, url.text, write_s=timeout_s, holder=on.holder)
    return UsbRig(transport, profile, stream=stream, watchdog_s=watchdog_s, signs=signs)


def _choice(url: DeviceUrl, name: str, known: tuple[str, ...]) -> str:
    """The option, or the first of the known ones."""
    text = str(url.one(name, known[0]))
    if text not in known:
        raise UsageError(
            f"{url.text}: {name}={text} is none of {', '.join(known)}.",
            cause="a typing error.",
            fix=f"{name}={known[0]}, or leave it out",
        )
    return text


def _seconds(url: DeviceUrl, name: str, most: float) -> float:
    text = str(url.one(name))
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 1e-3 <= value <= most:
        raise UsageError(
            f"{url.text}: {name}={text} is not a time from 0.001 to {most:g} s.",
            cause="a typing error or another unit.",
            fix=f"{name}=0.1",
        )
    return value
