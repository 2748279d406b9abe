"""``heli3dof doctor``'s checks of a USB rig: libusb, the udev rule, and the rig of the URL."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

from heli3dof.errors import DeviceError
from heli3dof.rig.interface import Check
from heli3dof.rig.url import DeviceUrl

from ..udev import INSTALLED, install_command, installed
from .devices import OnBus, select

SPEEDS = {1: "low, 1.5 Mbit/s", 2: "full, 12 Mbit/s", 3: "high, 480 Mbit/s", 4: "super, 5 Gbit/s"}


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
        checks += _on_linux(on)
    return checks


def _on_linux(on: OnBus) -> list[Check]:
    permitted = os.access(on.node, os.R_OK | os.W_OK)
    checks = [
        Check(
            "permission",
            f"this user {'may' if permitted else 'may not'} open {on.node}",
            permitted,
            "" if permitted else install_command(),
        )
    ]
    if holder := on.holder():
        checks.append(Check("in use", f"by {holder}", None, "end it before a run"))
    return checks
