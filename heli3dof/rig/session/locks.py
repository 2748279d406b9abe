"""Locks on rigs: one of the port before it is opened, one of the device once it is known.

    port     <runtime>/<device>.lock        of the URL's place
    device   <runtime>/<serial>-<…>.rig     of IDENTITY's serial number and boot, so that a rig with
                                            two doors (a pipe and a port) flies through one of them
    holder   <lock>.json                    who holds it: a file of its own, since Windows lets no
                                            other process read what is locked

The system frees a lock as soon as its process is gone, ``kill -9`` included (the filelock library:
flock, or LockFileEx on Windows). The boot counts since serial numbers are not always unique:
emulated rigs and freshly flashed boards share a factory's.
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
"""s for which, and after which, a lock is tried again: `is_held` takes it for an instant"""


class Lock:
    """Held from its making to `release`; `write_holder` says by whom.

    Raises DeviceError (busy) naming the holder. ``device``: the URL for messages.
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
        """Say who holds it. In place: Windows replaces no file that another process reads."""
        holder_path(self._path).write_text(json.dumps(about), encoding="utf-8")

    def release(self) -> None:
        """Let go; the files go too. Idempotent."""
        if self._lock.is_locked:
            for path in (holder_path(self._path), self._path):
                with contextlib.suppress(OSError):
                    path.unlink()
            self._lock.release()


def is_held(path: Path) -> bool:
    """Whether a process holds this lock now."""
    try:
        Lock(path, "").release()
    except DeviceError:
        return True
    return False


def holder_path(lock: Path) -> Path:
    """The file that says who holds a lock."""
    return lock.with_name(lock.name + HOLDER)


def read_holder(lock: Path) -> dict[str, Any]:
    """What its holder wrote; empty where it has not, or just writes it."""
    try:
        found = json.loads(holder_path(lock).read_bytes())
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def device_lock_path(serial: str, boot: int | None) -> Path:
    """Where a device is locked that calls itself so; the same through each of its doors."""
    readable = re.sub(r"[^A-Za-z0-9]+", "-", serial).strip("-")[:24]
    return runtime_folder() / f"{readable}-{binascii.crc32(f'{serial}/{boot}'.encode()):08x}.rig"


def busy(device: str, about: Mapping[str, Any]) -> DeviceError:
    """The error of a rig that another session holds."""
    try:
        who = f"pid {about['pid']} runs `{about['doing']}` since {about['since_utc']}"
        if about["device"] != device:
            who += f", through {about['device']}"
        fix = "wait for it, heli3dof monitor to watch it, or Ctrl-C in its terminal to land it"
    except KeyError:
        who, fix = "another heli3dof is just taking or leaving it", "try again"
    return DeviceError(
        f"{device} is busy: {who}.", cause="one rig flies one experiment at a time.", fix=fix
    )
