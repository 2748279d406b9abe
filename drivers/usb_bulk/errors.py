"""Maps the errors of the USB bus to messages: what happened, the likely cause, what to do.

pyusb replaces each error of the library libusb by an errno constant, such as ENODEV. On every
operating system it uses the same names of constants, so one table of messages is enough.
"""

from __future__ import annotations

import errno
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from heli3dof.errors import DeviceError

from ..errors import ErrorTable, ErrorTemplate
from ..udev import install_command

NO_LIBUSB = {
    "linux": "sudo apt install libusb-1.0-0  (Fedora: sudo dnf install libusb1)",
    "darwin": "brew install libusb",
    "win32": "pip install libusb-package, or put libusb-1.0.dll next to python.exe",
}

_NO_DRIVER = ErrorTemplate(
    "{name}: libusb cannot reach this rig.",
    "no driver that libusb can use is bound to it (Windows needs WinUSB).",
    "Windows: bind WinUSB to it with Zadig; elsewhere: heli3dof doctor",
)
ERRORS: ErrorTable = {
    errno.ENODEV: ErrorTemplate(
        "{name} was unplugged while {doing}.",
        "the cable or a hub came out, or the amplifier lost its power. The rig stops "
        "itself when the bus goes.",
        "plug it in and secure the cable; heli3dof devices shows when it is back",
    ),
    errno.EPIPE: ErrorTemplate(
        "{name} stalled while {doing}, and again after it was cleared.",
        "its firmware refuses this pipe: a firmware error, or not a heli3dof rig.",
        "unplug the cable and plug it in again; if that does not help: heli3dof doctor",
    ),
    errno.ETIMEDOUT: ErrorTemplate(
        "{name} did not answer in time while {doing}.",
        "its firmware hangs, or another device occupies the bus.",
        "switch the amplifier off and on; plug the rig in without a hub",
    ),
    **dict.fromkeys(
        (errno.EACCES, errno.EPERM),
        ErrorTemplate(
            "{name}: this user has no permission to open it.",
            "the udev rule is not installed, or was not when the rig was plugged in, or you "
            "are logged in by ssh.",
            "{install}; with ssh also: sudo usermod -aG dialout $USER, then log in again",
        ),
    ),
    errno.EBUSY: ErrorTemplate(
        "{name} is in use{by}.",
        "another process runs or monitors it; one process at a time may.",
        "end that process. heli3dof estop stops the motors even while it holds the rig",
    ),
    errno.EOVERFLOW: ErrorTemplate(
        "{name} sent more than was requested while {doing}.",
        "its firmware sends packets longer than its descriptor states.",
        "update the firmware; docs/reference/protocol.md, section USB",
    ),
    errno.EIO: ErrorTemplate(
        "{name}: USB transfer failed while {doing}.",
        "a bad cable or hub, interference from a motor, or the cable was just unplugged.",
        "use a short shielded cable and no hub; then heli3dof devices",
    ),
}
"""errno → texts"""


def no_libusb() -> DeviceError:
    """Return the error for a system where pyusb is installed, but not libusb."""
    return DeviceError(
        "No USB rig can be opened: libusb is missing.",
        cause="pyusb needs the system's libusb 1.0 and does not find it.",
        fix=NO_LIBUSB.get(sys.platform, "install libusb 1.0 from your system's packages"),
    )


def explain(
    error: BaseException, name: str, doing: str, holder: Callable[[], str] = lambda: ""
) -> DeviceError:
    """Return the DeviceError that explains ``error``, an exception of pyusb.

    ``name``: the rig's URL; ``doing``: the operation that failed, as text, e.g. "taking a command".
    ``holder`` returns the process that uses the rig; it is called only if the rig is busy.
    """
    if isinstance(error, NotImplementedError):
        return _NO_DRIVER.error(name=name)
    number = getattr(error, "errno", None)
    known = None if number is None else ERRORS.get(number)
    if known is not None:
        process = holder() if number == errno.EBUSY else ""
        by = f" by {process}" if process else ""
        return known.error(name=name, doing=doing, by=by, install=install_command())
    return DeviceError(
        f"{name}: {error} while {doing}.",
        cause=f"the bus reports errno {number}, which this driver does not know.",
        fix="heli3dof doctor",
    )


@contextmanager
def explained(name: str, doing: str, holder: Callable[[], str] = lambda: "") -> Iterator[None]:
    """Context manager: replace a USB error by the DeviceError that `explain` returns for it."""
    import usb.core

    failures: tuple[Any, ...] = (usb.core.USBError, NotImplementedError)
    try:
        yield
    except failures as error:
        raise explain(error, name, doing, holder) from error
