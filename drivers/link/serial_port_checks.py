"""Checks a serial port for ``doctor`` without opening it: file, permission, lock, latency."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence

from heli3dof.rig.interface import Check

from .serial_ports import (
    QUICK_MS,
    holders,
    latency_timer,
    lockers,
    named,
    permission_fix,
    usb_ports,
)


def checks(path: str) -> Sequence[Check]:
    """Return checks of the port ``path``: file, permission, programs that use it, latency timer."""
    if not os.path.exists(path):
        there = ", ".join(usb_ports()) or "none on USB"
        return (Check("port", f"{path} is not there (ports: {there})", False, "plug the rig in"),)
    if not stat.S_ISCHR(os.stat(path).st_mode):
        return (Check("port", f"{path} is not a serial port", False, "heli3dof devices"),)
    return (Check("port", path, True), _permission(path), _holder(path), _latency(path))


def _permission(path: str) -> Check:
    if os.access(path, os.R_OK | os.W_OK):
        return Check("permission", "this user may open it", True)
    return Check(
        "permission", "this user has no permission to open it", False, permission_fix(path)
    )


def _holder(path: str) -> Check:
    what = "held by"
    if locked := lockers(path):
        fix = f"wait until it ends; if it runs no rig: kill {locked[0][0]}"
        return Check(what, f"{named(locked)}: locked", False, fix)
    if opened := holders(path):
        fix = "end this process, unless it is the emulator of this rig"
        return Check(what, f"{named(opened)}: open, but not locked", None, fix)
    return Check(what, "no visible process", True)


def _latency(path: str) -> Check:
    timer = latency_timer(path)
    if timer is None:
        return Check("latency timer", "the adapter has none", True)
    ms, file = timer
    if ms <= QUICK_MS:
        return Check("latency timer", f"{ms} ms", True)
    return Check(
        "latency timer",
        f"{ms} ms: samples arrive in bursts",
        False,
        f"echo {QUICK_MS} | sudo tee {file}",
    )
