"""``serial:`` — a rig on a serial port, or at anything else that pyserial opens.

``serial:///dev/ttyACM0?baud=921600`` · ``serial://COM3`` · ``serial+socket://host:port`` ·
``serial+rfc2217://host:port`` · ``serial+spy:///dev/ttyACM0?file=bytes.txt``: what stands behind
the ``+`` is pyserial's own scheme. The bytes are docs/reference/protocol.md's.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import urlencode

from heli3dof.errors import UsageError
from heli3dof.rig.interface import Check, Rig

if TYPE_CHECKING:
    from heli3dof.rig.profile import Profile
    from heli3dof.rig.url import DeviceUrl

    from .link.transport import Transport

OURS = ("baud", "stream", "watchdog_s", "low_latency", "signs")
PYSERIALS = ("file", "all", "raw", "color", "logging", "timeout", "ign_set_control", "poll_modem")
"""Options of pyserial's own URLs, handed on to it."""


class SerialDriver:
    """Opens rigs on serial ports."""

    scheme = "serial"
    options: Sequence[str] = OURS + PYSERIALS

    def find(self) -> Sequence[str]:
        """The serial ports on USB. Whether a rig is behind one, only opening it tells."""
        from .link.serial_ports import usb_ports

        return [f"serial://{port}" for port in usb_ports()]

    def is_rig(self, url: DeviceUrl) -> bool:
        """Whether a rig is there: by its USB number, or since a heli3dof holds the port now."""
        from .link.serial_ports import is_known

        return is_known(url.where)

    def persistent_name(self, url: DeviceUrl) -> str:
        """What is plugged in there, by its USB serial number; ttyUSB0 may be another one's soon."""
        from .link.serial_ports import plugged_in

        return url.where if "+" in url.scheme else plugged_in(url.where)

    def open(self, url: DeviceUrl, profile: Profile) -> Rig:
        """Take the port for this process alone, and greet the rig."""
        from .link.rig import LinkRig
        from .link.serial_line import open_line

        options = Options.of(url)
        line = open_line(options.place, baud=options.baud, low_latency=options.low_latency)
        return LinkRig(
            line,
            profile,
            driver="serial",
            stream=options.stream,
            watchdog_s=options.watchdog_s,
            signs=options.signs,
        )

    def estop(self, url: DeviceUrl) -> str:
        """Stop the rig's motors, though another process may hold its port."""
        from .link.emergency_stop import stop_over
        from .link.serial_line import open_line
        from .link.shared_open import open_beside

        options = Options.of(url)
        line: Transport | None = None
        if os.path.exists(options.place):
            line = open_beside(options.place)
        beside = line is not None
        line = line or open_line(options.place, baud=options.baud)
        try:
            return stop_over(line, beside=beside)
        finally:
            line.close()

    def examine(self, url: DeviceUrl) -> Sequence[Check]:
        """The port's file, permission, holder and latency timer; nothing is opened."""
        from .link.serial_port_checks import checks

        options = Options.of(url)
        return () if "://" in options.place else checks(options.place)


@dataclass(frozen=True)
class Options:
    """The URL's place and options, checked."""

    place: str
    """as pyserial writes it"""
    baud: int
    stream: bool
    watchdog_s: float | None
    low_latency: bool
    signs: str

    @staticmethod
    def of(url: DeviceUrl) -> Options:
        """Raises UsageError for an option that makes no sense."""
        from .link.serial_line import BAUD, pyserial_url

        url.check_options(OURS + PYSERIALS)
        place = pyserial_url(url.scheme, url.where)
        handed_on = [(n, v) for n in PYSERIALS for v in url.options.get(n, ())]
        if handed_on:
            if "://" not in place:
                raise UsageError(
                    f"{url.text}: {handed_on[0][0]} is an option of pyserial's own URLs.",
                    cause="a plain port has no such option.",
                    fix=f"serial+spy://{url.where}?{urlencode(handed_on)}",
                )
            place += "?" + urlencode(handed_on)
        watchdog = url.one("watchdog_s")
        return Options(
            place,
            baud=int(_number(url, "baud", str(BAUD), 1200, 12_000_000)),
            stream=_choice(url, "stream", "1", ("0", "1")) == "1",
            watchdog_s=None if watchdog is None else _number(url, "watchdog_s", "0.1", 1e-3, 1),
            low_latency=_choice(url, "low_latency", "1", ("0", "1")) == "1",
            signs=_choice(url, "signs", "device", ("device", "profile")),
        )


def _number(url: DeviceUrl, name: str, default: str, low: float, high: float) -> float:
    text = str(url.one(name, default))
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise UsageError(
            f"{url.text}: {name}={text} is not a number from {low:g} to {high:g}.",
            cause="a typing error or another unit.",
            fix=f"{name}={default}",
        )
    return value


def _choice(url: DeviceUrl, name: str, default: str, known: tuple[str, ...]) -> str:
    text = str(url.one(name, default))
    if text not in known:
        raise UsageError(
            f"{url.text}: {name}={text} is none of {', '.join(known)}.",
            cause="a typing error.",
            fix=f"{name}={default}",
        )
    return text
