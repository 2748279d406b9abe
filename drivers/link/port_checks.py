"""What ``doctor`` asks of a serial port before it is opened: file, permission, holder, latency."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence

from heli3dof.rig.port import Check

from .ports import QUICK_MS, holders, latency_timer, permission_fix, usb_ports


def checks(path: str) -> Sequence[Check]:
    """One `Check` a thing; opens nothing."""
    if not os.path.exists(path):
        there = ", ".join(usb_ports()) or "none on USB"
        return (Check("port", f"{path} is not there (ports: {there})", False, "plug the rig in"),)
    if not stat.S_ISCHR(os.stat(path).st_mode):
        return (Check("port", f"{path} is no serial port", False, "heli3dof devices"),)
    return (Check("port", path, True), _permission(path), _holder(path), _latency(path))


def _permission(path: str) -> Check:
    if os.access(path, os.R_OK | os.W_OK):
        return Check("permission", "this user may open it", True)
    return Check("permission", "this user may not open it", False, permission_fix(path))


def _holder(path: str) -> Check:
    found = holders(path)
    if not found:
        return Check("held by", "no process that we can see", True)
    who = ", ".join(f"process {pid} ({name})" for pid, name in found)
    return Check("held by", who, False, f"end it (kill {found[0][0]}) if it flies no rig")


def _latency(path: str) -> Check:
    timer = latency_timer(path)
    if timer is None:
        return Check("latency timer", "the adapter has none", True)
    ms, file = timer
    if ms <= QUICK_MS:
        return Check("latency timer", f"{ms} ms", True)
    return Check(
        "latency timer",
        f"{ms} ms: samples come in lumps",
        False,
        f"echo {QUICK_MS} | sudo tee {file}",
    )
