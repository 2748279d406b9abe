"""A rig on USB: the link over bulk transfers, and a stop by control request."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING, Any

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Sample

from ..link.frames import Cause
from ..link.rig import LinkRig

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile

    from .transport import UsbTransport


class UsbRig(LinkRig):
    """An open rig on USB bulk pipes; implements `heli3dof.rig.interface.Rig`."""

    def __init__(self, pipe: UsbTransport, profile: Profile, **options: Any) -> None:
        """Open the rig at ``pipe``; ``options``: keyword arguments for `LinkRig`."""
        self._pipe = pipe
        super().__init__(pipe, profile, driver="usb", **options)

    def arm(self) -> Sample:
        self._pipe.follow_scheduling()
        return super().arm()

    def estop(self, reason: str) -> None:
        """Set zero volts now, by a USB control request and then by an ESTOP frame."""
        if not self._open:
            return
        try:
            self._pipe.stop(Cause.HOST_ESTOP)
        except DeviceError:
            super().estop(reason)
            return
        with suppress(DeviceError):  # it has stopped; the next transfer reports a dead pipe
            super().estop(reason)
