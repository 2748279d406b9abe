"""Describes and checks the serial ports: which exist, which process uses one, latency."""

from __future__ import annotations

import os
import stat
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from heli3dof.rig.interface import Check

QUICK_MS = 1
"""ms, the shortest FTDI latency timer"""
PSEUDO = "/dev/pts/"
LATENCY_FILES = (
    "/sys/bus/usb-serial/devices/{}/latency_timer",
    "/sys/class/tty/{}/device/latency_timer",
)


def usb_ports() -> Sequence[str]:
    """Return the device files of all serial ports on USB, without opening them.

    A motherboard's own ports are omitted: they exist whether or not a rig is connected.
    """
    from serial.tools.list_ports import comports

    return sorted(p.device for p in comports() if p.vid is not None)


def is_known(path: str) -> bool:
    """Return True if a rig is probably connected to the port ``path``.

    Either the port's USB vendor and product numbers are a known rig's, or a heli3dof process,
    perhaps another user's, has locked the port.
    """
    from ..udev import known_ids

    port = _on_usb(path)
    if port is not None and (port.vid, port.pid) in known_ids():
        return True
    return any(_runs_heli3dof(pid) for pid, _ in lockers(path))


def persistent_name(path: str) -> str:
    """Return a name for the device that is connected to the port ``path``.

    The name of a USB device consists of the vendor number, the product number and the serial
    number, so it does not depend on the port. If the device has no serial number, the name contains
    the USB port instead. The name of a pseudo-terminal is its path with its creation time, because
    the system reuses the path. The name at any other port is the port's path.
    """
    if path.startswith(PSEUDO):
        return f"{path} of {os.stat(path).st_ctime_ns}" if os.path.exists(path) else path
    port = _on_usb(path)
    if port is None:
        return path
    where = port.serial_number or f"at {port.location}"
    return f"{port.vid:04x}:{port.pid:04x} {where}"


def _on_usb(path: str) -> Any:
    from serial.tools.list_ports import comports

    real = os.path.realpath(path)
    return next((p for p in comports() if p.vid is not None and p.device == real), None)


def _runs_heli3dof(pid: int) -> bool:
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return False
    return any(os.path.basename(word) == b"heli3dof" for word in words)


def holders(path: str) -> list[tuple[int, str]]:
    """Return (pid, name) of each other process that has ``path`` open, as /proc shows."""
    try:
        wanted = os.stat(path).st_rdev
    except OSError:
        return []
    holding = []
    for process in Path("/proc").glob("[0-9]*"):
        if int(process.name) == os.getpid():
            continue
        try:
            if any(_is(fd, wanted) for fd in (process / "fd").iterdir()):
                holding.append((int(process.name), (process / "comm").read_text().strip()))
        except OSError:  # another user's, or ended meanwhile
            continue
    return sorted(holding)


def _is(fd: Path, device: int) -> bool:
    try:
        return os.readlink(fd).startswith("/dev/") and os.stat(fd).st_rdev == device
    except OSError:
        return False


def lockers(path: str) -> list[tuple[int, str]]:
    """Return (pid, name) of every process that holds a lock (flock) on the port ``path``."""
    try:
        file = os.stat(path)
        locks = Path("/proc/locks").read_text(encoding="ascii")
    except OSError:
        return []
    place = f"{os.major(file.st_dev):02x}:{os.minor(file.st_dev):02x}:{file.st_ino}"
    # 1: FLOCK  ADVISORY  WRITE 4711 00:15:3 0 EOF
    rows = [line.split() for line in locks.splitlines()]
    pids = {int(row[4]) for row in rows if "FLOCK" in row and place in row and row[4].isdigit()}
    return [(pid, _name(pid)) for pid in sorted(pids)]


def named(processes: list[tuple[int, str]]) -> str:
    """Return the (pid, name) pairs as text: ``process 123 (python), …``."""
    return ", ".join(f"process {pid} ({name})" for pid, name in processes)


def held_by(path: str) -> str:
    """Return the names of the processes that have locked the port ``path``.

    If no process has locked the port, the names are those of the processes that have opened it.
    """
    return named(lockers(path) or holders(path)) or "a process of another user"


def _name(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/comm").read_text(encoding="utf-8").strip()
    except OSError:
        return "another user's"


def latency_timer(path: str) -> tuple[int, Path] | None:
    """Return an FTDI adapter's latency timer in ms and the file that sets it.

    Returns None for a port without such a timer.
    """
    name = Path(os.path.realpath(path)).name
    for place in LATENCY_FILES:
        file = Path(place.format(name))
        try:
            return int(file.read_text()), file
        except (OSError, ValueError):
            continue
    return None


def permission_fix(path: str) -> str:
    """Return the shell command that gives this user permission to open the port ``path``."""
    try:
        import grp

        group = grp.getgrgid(os.stat(path).st_gid).gr_name
    except (ImportError, OSError, KeyError):
        group = "dialout"
    if group in ("root", "tty"):
        from ..udev import install_command

        return install_command()
    return f"sudo usermod -aG {group} $USER, then log in again"


def checks(path: str) -> Sequence[Check]:
    """Return checks of the closed port ``path``: file, permission, programs using it, latency."""
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
