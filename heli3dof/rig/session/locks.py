"""Locks a rig, so that only one process uses it.

A process locks the rig's port before it opens the port. Then it reads the device's serial number,
and locks the device.

    lock of the port      <runtime>/<name>.lock            <name>: made from the device's URL
    lock of the device    <runtime>/<number>-<hash>.rig    <number>: the device's serial number
    holder file           <path of the lock>.json          states which process holds the lock

<runtime> is the folder `runtime_folder`. A device has one lock for all of its ports (USB pipe,
serial port). <hash> is a hash of the device's serial number and boot number. The boot number
changes at every start of the device. It is part of the hash because emulated rigs and newly flashed
boards may have the same serial number. The holder file is separate from the lock, because on
Windows no other process can read a locked file.

The filelock library locks with flock, or LockFileEx on Windows. The operating system releases a
lock when the process that holds the lock ends, even by ``kill -9``.
"""

from __future__ import annotations

import binascii
import contextlib
import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from heli3dof.errors import DeviceError
from heli3dof.rig.session.paths import runtime_folder

HOLDER = ".json"
TAKE_S, TRY_S = 0.1, 0.01
"""s: time limit of all attempts to lock, and time between two attempts. The attempts are repeated
because `is_held` takes a free lock for an instant"""


class Lock:
    """A lock on a file, held from construction until `release`.

    Raises DeviceError, naming the holder, if another process has locked the file. ``device``: the
    rig's URL, for the error's message.
    """

    def __init__(self, path: Path, device: str) -> None:
        from filelock import FileLock, Timeout

        self._path = path
        self._lock = FileLock(path, timeout=TAKE_S, thread_local=False)
        try:
            self._lock.acquire(poll_interval=TRY_S)
        except Timeout:
            raise busy(device, read_holder(path)) from None

    def write_holder(self, about: Mapping[str, Any]) -> None:
        """Write ``about`` to the holder file, in place: Windows cannot replace an open file."""
        holder_path(self._path).write_text(json.dumps(about), encoding="utf-8")

    def release(self) -> None:
        """Release the lock and delete its files. Idempotent."""
        if self._lock.is_locked:
            for path in (holder_path(self._path), self._path):
                with contextlib.suppress(OSError):
                    path.unlink()
            self._lock.release()


def is_held(path: Path) -> bool:
    """Return True if any process holds the lock on the file ``path`` now."""
    try:
        Lock(path, "").release()
    except DeviceError:
        return True
    return False


def holder_path(lock: Path) -> Path:
    return lock.with_name(lock.name + HOLDER)


def read_holder(lock: Path) -> dict[str, Any]:
    """Return the data in a lock's holder file; empty if the file is missing or incomplete."""
    try:
        content = json.loads(holder_path(lock).read_bytes())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}


def device_lock_path(serial: str, boot: int | None) -> Path:
    """Return the path of a device's lock file, the same for all of its ports."""
    readable = re.sub(r"[^A-Za-z0-9]+", "-", serial).strip("-")[:24]
    return runtime_folder() / f"{readable}-{binascii.crc32(f'{serial}/{boot}'.encode()):08x}.rig"


def busy(device: str, about: Mapping[str, Any]) -> DeviceError:
    """Return the error for a rig in use; ``about`` is the content of the lock's holder file."""
    try:
        who = f"pid {about['pid']} runs `{about['doing']}` since {about['since_utc']}"
        if about["device"] != device:
            who += f", through {about['device']}"
        fix = "wait for it, heli3dof monitor to watch it, or Ctrl-C in its terminal to land it"
    except KeyError:
        who, fix = "another heli3dof is opening or closing it", "try again"
    return DeviceError(
        f"{device} is busy: {who}.", cause="a rig runs one experiment at a time.", fix=fix
    )
