"""Driver of ``usb://VID:PID/SERIAL``: a rig on a pair of USB bulk pipes.

VID:PID, SERIAL or both may be omitted where only one rig fits. The options are listed in
docs/how-to/connect-a-rig.md.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Check

from .devices import examine, kernel_lists_one, on_bus, select, system_backend

if TYPE_CHECKING:
    from heli3dof.rig.interface import Rig
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from ..options import UsbOptions

STOP_TRIES = 8
"""Attempts of 0.25 s each; many, because a process that has not claimed the rig can only stop it by
this control request"""


class UsbDriver:
    """Opens rigs on USB. ``backend`` returns the backend of pyusb, such as libusb."""

    scheme = "usb"
    options: Sequence[str] = ("stream", "watchdog_s", "signs", "timeout_s")
    """The fields of `UsbOptions`, repeated so that `estop` need not import pydantic (slow)"""

    def __init__(self, backend: Callable[[], Any] = system_backend) -> None:
        self._backend = backend

    def find(self) -> Sequence[str]:
        """Return the URLs of the rigs on the USB bus; an empty list if libusb is missing."""
        if self._backend is system_backend and not kernel_lists_one():
            return []
        import usb.core

        try:
            return [rig.url for rig in on_bus(self._backend())]
        except (DeviceError, usb.core.USBError):
            return []

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Claim the USB rig of ``url`` and return it. Raises DeviceError or UsageError."""
        from ..options import UsbOptions

        options = UsbOptions.of(url)
        return open_on(self._backend(), url, profile, options)

    def estop(self, url: DeviceUrl) -> str:
        """Stop the rig by a USB control request, even if a process uses it; return a message."""
        import usb.util

        from ..link.frames import Cause
        from .transport import stop

        on = select(self._backend(), url.text, url.where)
        stop(on.device, Cause.HOST_ESTOP, url.text, STOP_TRIES)
        with suppress(Exception):
            usb.util.dispose_resources(on.device)
        return f"{on.url} confirmed the stop; its output is zero until it is armed again"

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """Return checks of libusb, the udev rule, and the rig (present, permitted, free)."""
        return examine(self._backend, url)


def open_on(
    bus: Any, url: DeviceUrl, profile: Profile, options: UsbOptions, where: str | None = None
) -> Rig:
    """Return the rig of ``url``, opened through pyusb's backend ``bus``.

    ``where``: ``VID:PID/SERIAL`` of the rig; None: as in ``url``.
    """
    from .rig import UsbRig
    from .transport import UsbTransport

    on = select(bus, url.text, url.where if where is None else where)
    transport = UsbTransport(on.device, url.text, write_s=options.timeout_s, holder=on.holder)
    return UsbRig(transport, profile, **options.of_rig)
