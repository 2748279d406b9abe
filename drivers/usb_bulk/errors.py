"""What went wrong on the bus, by errno: what happened, the likely cause, what to do.

libusb's errors reach us through pyusb as errno, the same on every system.
"""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from heli3dof.errors import DeviceError

from ..error_table import Trouble, Troubles, each
from ..udev import install_command

NO_LIBUSB = {
    "linux": "sudo apt install libusb-1.0-0  (Fedora: sudo dnf install libusb1)",
    "darwin": "brew install libusb",
    "win32": "pip install libusb-package, or libusb-1.0.dll beside python.exe",
}

_OUT_OF_REACH = Trouble(
    "{name}: the system does not let libusb reach this rig.",
    "no driver that libusb can use is bound to it (Windows: WinUSB).",
    "Windows: bind WinUSB to it with Zadig; elsewhere: heli3dof doctor",
)
TROUBLES: Troubles = {
    errno.ENODEV: Trouble(
        "{name} was unplugged while {doing}.",
        "the cable or a hub came out, or the amplifier lost its power. The rig stops "
        "itself when the bus goes.",
        "plug it in and secure the cable; heli3dof devices shows when it is back",
    ),
    errno.EPIPE: Trouble(
        "{name} stalled while {doing}, and again after it was cleared.",
        "its firmware refuses this pipe: a fault in the firmware, or not a heli3dof rig.",
        "take the cable out and put it back; if it stays: heli3dof doctor",
    ),
    errno.ETIMEDOUT: Trouble(
        "{name} did not answer in time while {doing}.",
        "its firmware hangs, or the bus is taken up by another device.",
        "switch the amplifier off and on; plug it into a port of its own, without a hub",
    ),
    **each(
        (errno.EACCES, errno.EPERM),
        Trouble(
            "{name} may not be opened by this user.",
            "the udev rule is not installed, or was not when the rig was plugged in, or you "
            "do not sit at this machine (ssh).",
            "{install}; by ssh also: sudo usermod -aG dialout $USER, then log in again",
        ),
    ),
    errno.EBUSY: Trouble(
        "{name} is in use{by}.",
        "another process flies it or watches it; a rig has one master.",
        "end that process. heli3dof estop stops the motors meanwhile, whoever holds it",
    ),
    errno.EOVERFLOW: Trouble(
        "{name} sent more than was asked for while {doing}.",
        "its firmware sends packets longer than its descriptor says.",
        "update the firmware; docs/reference/protocol.md, section USB",
    ),
    errno.EIO: Trouble(
        "{name}: the bus failed while {doing}.",
        "a bad cable or hub, a motor's interference, or the cable coming out just then.",
        "a short shielded cable, a port without a hub; then heli3dof devices",
    ),
}
"""libusb's, by errno"""


def no_libusb() -> DeviceError:
    """pyusb is there and its library is not."""
    return DeviceError(
        "No USB rig can be opened: libusb is not there.",
        cause="pyusb talks to the bus through the system's libusb 1.0, and finds none.",
        fix=NO_LIBUSB.get(sys.platform, "install libusb 1.0 from your system's packages"),
    )


def explain(
    error: BaseException, name: str, doing: str, holder: Callable[[], str] = lambda: ""
) -> DeviceError:
    """The error for a user. ``name``: the rig's URL; ``doing``: "taking a command", for example.

    ``holder`` says who holds the rig; it is asked only where that matters.
    """
    if isinstance(error, NotImplementedError):
        return _OUT_OF_REACH.error(name=name)
    number = getattr(error, "errno", None)
    known = None if number is None else TROUBLES.get(number)
    if known is not None:
        who = holder() if number == errno.EBUSY else ""
        by = f" by {who}" if who else ""
        return known.error(name=name, doing=doing, by=by, install=install_command())
    return DeviceError(
        f"{name}: {error} while {doing}.",
        cause=f"the bus reports errno {number}, which this driver does not know.",
        fix="heli3dof doctor",
    )


@contextmanager
def explained(name: str, doing: str, holder: Callable[[], str] = lambda: "") -> Iterator[None]:
    """Every error of the bus within becomes a DeviceError."""
    import usb.core

    failures: tuple[Any, ...] = (usb.core.USBError, NotImplementedError)
    try:
        yield
    except failures as error:
        raise explain(error, name, doing, holder) from error
