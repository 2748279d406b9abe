"""Driver of ``serial:`` URLs: a rig on a serial port, or on anything else that pyserial opens.

``serial:///dev/ttyACM0?baud=921600`` · ``serial://COM3`` · ``serial+socket://host:port`` ·
``serial+rfc2217://host:port`` · ``serial+spy:///dev/ttyACM0?file=bytes.txt``: the part after the
``+`` is pyserial's own scheme. docs/reference/protocol.md defines the bytes.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from heli3dof.rig.interface import Check, Rig

from .link.serial_line import BAUD, PASSED_ON

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from .link.request_reply import Transport


class SerialDriver:
    """Opens rigs on serial ports."""

    scheme = "serial"
    options: Sequence[str] = (
        "stream", "watchdog_s", "signs", "baud", "low_latency", *PASSED_ON,
    )  # fmt: skip
    """The fields of `SerialOptions`, repeated so that `estop` need not import pydantic (slow)"""

    def find(self) -> Sequence[str]:
        """Return the URLs of the serial ports on USB, whether a rig is connected or not."""
        from .link.serial_ports import usb_ports

        return [f"serial://{port}" for port in usb_ports()]

    def is_rig(self, url: DeviceUrl) -> bool:
        """Return True if the port probably has a rig: known USB IDs, or heli3dof has locked it."""
        from .link.serial_ports import is_known

        return is_known(url.where)

    def persistent_name(self, url: DeviceUrl) -> str:
        """Return a name of the device; with a USB serial number it is the same at every port."""
        from .link.serial_ports import persistent_name

        return url.where if "+" in url.scheme else persistent_name(url.where)

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Open the port for this program only, and return the rig that is connected to it."""
        from .link.rig import LinkRig
        from .link.serial_line import open_line, pyserial_url
        from .options import SerialOptions

        options = SerialOptions.of(url)
        line = open_line(
            pyserial_url(url), baud=int(options.baud), low_latency=options.low_latency == "1"
        )
        return LinkRig(line, profile, driver="serial", **options.of_rig)

    def estop(self, url: DeviceUrl) -> str:
        """Stop the rig's motors, even if another process has its port open; return a message."""
        from .link.emergency_stop import stop_over
        from .link.serial_line import open_line, open_shared, pyserial_url

        place, baud = pyserial_url(url), _baud(url)
        line: Transport | None = None
        if os.path.exists(place):
            line = open_shared(place)
        shared = line is not None
        line = line or open_line(place, baud=baud)
        try:
            return stop_over(line, shared=shared)
        finally:
            line.close()

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """Return checks of the port without opening it: file, permission, lock, latency timer."""
        from .link.serial_line import pyserial_url
        from .link.serial_ports import checks
        from .options import SerialOptions

        SerialOptions.of(url)
        place = pyserial_url(url)
        return () if "://" in place else checks(place)


def _baud(url: DeviceUrl) -> int:
    text = url.one("baud", str(BAUD))
    if str(text).isdecimal():
        return int(str(text))
    from .options import SerialOptions

    return int(SerialOptions.of(url).baud)
