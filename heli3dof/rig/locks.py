"""Locks on rigs: one of the port before it is opened, one of the device once it has said its name.

    port     <runtime>/<device>.lock        of the URL's place; who holds it is written into it
    device   <runtime>/<serial>-<…>.rig     of IDENTITY's serial number and boot, so that a rig with
                                            two doors (a pipe and a port) flies through one of them

Both are flocks: free as soon as their process is gone, ``kill -9`` included. The boot counts since
serial numbers are not always unique: emulated rigs and freshly flashed boards share a factory's.
"""

from __future__ import annotations

import binascii
import contextlib
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from heli3dof.errors import DeviceError
from heli3dof.rig.places import runtime_folder

LONGEST_TEXT = 4096


class Lock:
    """Held from its making to `release`; ``about`` tells others who holds it.

    Raises DeviceError (busy) naming the holder. ``device``: the URL for messages; ``passing``: the
    file goes when the lock does.
    """

    def __init__(self, path: Path, device: str, *, passing: bool = False) -> None:
        self.path, self._passing = path, passing
        self._handle = _locked(path, device)

    def tell(self, about: Mapping[str, Any]) -> None:
        """What others read in it."""
        os.ftruncate(self._handle, 0)
        os.pwrite(self._handle, json.dumps(about).encode(), 0)

    def release(self) -> None:
        """Idempotent."""
        if self._handle < 0:
            return
        with contextlib.suppress(OSError):
            if self._passing:
                self.path.unlink()
            else:
                os.ftruncate(self._handle, 0)
        os.close(self._handle)
        self._handle = -1


def device_lock_path(serial: str, boot: int | None) -> Path:
    """Where a device is locked that calls itself so; the same through each of its doors."""
    readable = re.sub(r"[^A-Za-z0-9]+", "-", serial).strip("-")[:24]
    return runtime_folder() / f"{readable}-{binascii.crc32(f'{serial}/{boot}'.encode()):08x}.rig"


def _locked(path: Path, device: str) -> int:
    import fcntl

    while True:
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            text = os.pread(handle, LONGEST_TEXT, 0)
            os.close(handle)
            raise busy(device, text) from None
        with contextlib.suppress(OSError):
            # One that was unlinked between our opening and our locking locks nothing.
            if os.fstat(handle).st_ino == path.stat().st_ino:
                return handle
        os.close(handle)


def busy(device: str, text: bytes) -> DeviceError:
    """The error of a rig that another session holds, from what its lock says."""
    try:
        about = json.loads(text)
        who = f"pid {about['pid']} runs `{about['doing']}` since {about['since_utc']}"
        if about["device"] != device:
            who += f", through {about['device']}"
        fix = f"wait for it, heli3dof monitor to watch it, or: kill -INT {about['pid']}"
    except (ValueError, KeyError, TypeError):
        who, fix = "another heli3dof is just taking or leaving it", "try again"
    return DeviceError(
        f"{device} is busy: {who}.", cause="one rig flies one experiment at a time.", fix=fix
    )
