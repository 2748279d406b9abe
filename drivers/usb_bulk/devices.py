"""Finds the rigs on the USB bus; selects a URL's rig, and checks it for ``doctor``.

A rig is recognised by an interface of class 0xFF, subclass 0x48, protocol 0x01, with any VID:PID
(USB vendor and product number). The search reads the operating system's copies of the descriptors
and, on Linux, of the serial numbers. It requests a serial number from the device only if the system
has no copy.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.interface import Check
from heli3dof.rig.url import DeviceUrl

from ..link.serial_ports import holders
from ..udev import INSTALLED, install_command, installed
from .errors import explained, no_libusb

CLASS, SUBCLASS, PROTOCOL = 0xFF, 0x48, 0x01
SYSFS = Path("/sys/bus/usb/devices")
SPEEDS = {1: "low, 1.5 Mbit/s", 2: "full, 12 Mbit/s", 3: "high, 480 Mbit/s", 4: "super, 5 Gbit/s"}
_WHERE = re.compile(r"([0-9a-fA-F]{1,4}):([0-9a-fA-F]{1,4})(?:/(.*))?|/?([^:]*)")


@dataclass(frozen=True)
class OnBus:
    """A rig that was found on the USB bus."""

    device: Any
    """usb.core.Device"""
    serial: str | None
    """Serial number; None: the rig has none, or it cannot be read, e.g. without permission"""

    @property
    def url(self) -> str:
        d = self.device
        text = f"usb://{d.idVendor:04x}:{d.idProduct:04x}"
        return text + (f"/{quote(self.serial, safe='')}" if self.serial else "")

    @property
    def node(self) -> Path:
        """Return the path of the rig's device file on Linux."""
        return Path(f"/dev/bus/usb/{self.device.bus or 0:03d}/{self.device.address or 0:03d}")

    def holder(self) -> str:
        """Return as text the other processes that have the rig open; "" if /proc shows none."""
        return ", ".join(f"{name} (process {pid})" for pid, name in holders(str(self.node)))


def kernel_lists_one() -> bool:
    """Return True if the kernel lists a rig's interface, or has no such list (not Linux).

    If False, there is no need to load libusb.
    """
    if not SYSFS.is_dir():
        return True
    wanted = (f"{CLASS:02x}", f"{SUBCLASS:02x}", f"{PROTOCOL:02x}")
    names = ("bInterfaceClass", "bInterfaceSubClass", "bInterfaceProtocol")
    for interface in SYSFS.glob("*:*"):
        try:
            if tuple((interface / name).read_text().strip() for name in names) == wanted:
                return True
        except OSError:  # unplugged meanwhile
            continue
    return False


def system_backend() -> Any:
    """Return pyusb's backend for the system's libusb. Raises DeviceError if that is missing."""
    from usb.backend import libusb1

    backend = libusb1.get_backend()
    if backend is None:
        raise no_libusb()
    return backend


def on_bus(backend: Any) -> Iterator[OnBus]:
    """Yield every rig on the USB bus; ``backend`` is pyusb's access to the bus."""
    import usb.core

    for device in usb.core.find(find_all=True, backend=backend):
        try:
            is_rig = interface_of(device) is not None
        except (usb.core.USBError, NotImplementedError):
            continue  # a device whose descriptors cannot be read is not a rig
        if is_rig:
            yield OnBus(device, _serial(device))


def interface_of(device: Any) -> Any:
    """Return the first USB interface of ``device`` that has a rig's class numbers, or None."""
    wanted = (CLASS, SUBCLASS, PROTOCOL)
    for configuration in device:
        for i in configuration:
            if (i.bInterfaceClass, i.bInterfaceSubClass, i.bInterfaceProtocol) == wanted:
                return i
    return None


def _serial(device: Any) -> str | None:
    """Return the serial number from sysfs (no permission needed), else from the device, or None."""
    import usb.core
    import usb.util

    if device.bus and device.port_numbers:
        path = SYSFS / f"{device.bus}-{'.'.join(map(str, device.port_numbers))}" / "serial"
        try:
            return path.read_text(encoding="utf-8").strip()
        except OSError:
            pass
    try:
        return str(device.serial_number) if device.iSerialNumber else None
    except (usb.core.USBError, NotImplementedError, ValueError):
        return None
    finally:
        usb.util.dispose_resources(device)


def select(backend: Any, text: str, where: str) -> OnBus:
    """Return the one rig that ``usb://VID:PID/SERIAL`` selects; either part or both may be omitted.

    ``text``: the whole URL, for messages; ``where``: its part ``VID:PID/SERIAL``; ``backend``:
    pyusb's access to the bus. Raises UsageError if ``where`` is malformed, DeviceError if no rig
    fits or several do.
    """
    match = _WHERE.fullmatch(where)
    if where.endswith("/"):
        raise UsageError(
            f"{text} has an empty serial number.",
            cause="nothing follows the /.",
            fix=f"--device {text.rstrip('/')}, if one rig fits; heli3dof devices lists them",
        )
    if match is None:
        raise UsageError(
            f"{text}: {where!r} is not VID:PID/SERIAL.",
            cause="vendor and product are four hexadecimal digits each.",
            fix="--device usb://1209:0001 or usb://1209:0001/SERIAL; heli3dof devices lists them",
        )
    vid, pid = (int(n, 16) if n else None for n in match.group(1, 2))
    serial = unquote(match.group(3) or match.group(4) or "") or None
    with explained(text, "looking for it"):
        present = list(on_bus(backend))
    fits = [
        d for d in present if vid is None or (d.device.idVendor, d.device.idProduct) == (vid, pid)
    ]
    if serial is not None:
        # A rig whose serial number cannot be read may be the one: opening it reports why.
        unread = [d for d in fits if d.serial is None]
        fits = [d for d in fits if d.serial == serial] or unread
    if len(fits) == 1:
        return fits[0]
    if fits:
        raise DeviceError(
            f"{text} means {len(fits)} rigs: {_listed(fits)}.",
            cause="several are plugged in, and the URL does not select one.",
            fix=f"--device {fits[0].url}",
        )
    raise DeviceError(
        f"{text} was not found; "
        + (f"there is {_listed(present)}." if present else "no USB rig was."),
        cause="unplugged, without power, or another serial number."
        if present
        else "unplugged, or without power; or it is a serial rig.",
        fix=f"--device {present[0].url}" if present else "heli3dof devices",
    )


def _listed(rigs: Sequence[OnBus]) -> str:
    return ", ".join(r.url for r in rigs)


def examine(backend: Callable[[], Any], url: DeviceUrl) -> Sequence[Check]:
    """Return the results of checks of the USB rig at ``url``, without claiming it.

    ``backend`` returns pyusb's access to the bus.
    """
    try:
        pyusb = backend()
    except DeviceError as error:
        return [Check("libusb", error.what, False, error.fix)]
    checks = [Check("libusb", "found", True)]
    rule = installed()
    if rule is not None:
        state = f"installed in {INSTALLED}" if rule else f"not in {INSTALLED}, or an older one"
        # Another rule or root may permit it too: the check of the permission below decides.
        checks.append(Check("udev rule", state, rule or None, "" if rule else install_command()))
    try:
        on = select(pyusb, url.text, url.where)
    except DeviceError as error:
        return [*checks, Check("USB rig", error.what, False, error.fix)]
    speed = SPEEDS.get(on.device.speed or 0, "unknown")
    serial = on.serial or "not readable"
    checks.append(Check("USB rig", f"{on.url}, serial number {serial}, speed {speed}", True))
    if sys.platform.startswith("linux") and on.node.exists():
        may = os.access(on.node, os.R_OK | os.W_OK)
        found = f"this user {'may' if may else 'may not'} open {on.node}"
        checks.append(Check("permission", found, may, "" if may else install_command()))
        if holder := on.holder():
            checks.append(Check("in use", f"by {holder}", None, "end it before a run"))
    return checks
