"""The udev rule that ships: who sits at the machine may open its rigs, without being root."""

from __future__ import annotations

import sys
from pathlib import Path

RULES = Path(__file__).parent / "70-heli3dof.rules"
INSTALLED = Path("/etc/udev/rules.d") / RULES.name


def install_command() -> str:
    """The command that installs the rule and applies it to what is plugged in already."""
    return (
        f"sudo cp '{RULES}' {INSTALLED.parent}/ && sudo udevadm control --reload && "
        "sudo udevadm trigger"
    )


def installed() -> bool | None:
    """Whether the rule stands installed as it ships; None where there is no udev."""
    if not sys.platform.startswith("linux"):
        return None
    try:
        return INSTALLED.read_bytes() == RULES.read_bytes()
    except OSError:
        return False
