"""The Linux udev rule that comes with heli3dof: it lets the logged-in user open USB rigs."""

from __future__ import annotations

import re
import sys
from pathlib import Path

RULES = Path(__file__).parent / "70-heli3dof.rules"
INSTALLED = Path("/etc/udev/rules.d") / RULES.name
_IDS = re.compile(r'^[^#]*idVendor\}=="([0-9a-fA-F]{4})".*idProduct\}=="([0-9a-fA-F]{4})"', re.M)


def install_command() -> str:
    """Return the shell command that installs the udev rule and applies it to connected devices."""
    return (
        f"sudo cp '{RULES}' {INSTALLED.parent}/ && sudo udevadm control --reload && "
        "sudo udevadm trigger"
    )


def known_ids() -> set[tuple[int, int]]:
    """Return the USB vendor and product numbers of all rigs that the udev rule names.

    Both heli3dof's rule and its installed copy are read, because a laboratory may add rigs to the
    copy.
    """
    text = ""
    for file in (RULES, INSTALLED):
        try:
            text += file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            continue
    return {(int(vendor, 16), int(product, 16)) for vendor, product in _IDS.findall(text)}


def installed() -> bool | None:
    """Return True if the udev rule is installed unchanged, else False; None if not on Linux."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        return INSTALLED.read_bytes() == RULES.read_bytes()
    except OSError:
        return False
