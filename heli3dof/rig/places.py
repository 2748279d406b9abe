"""Where this user's running sessions and stored calibrations live, and what a device is called.

- runtime: ``$XDG_RUNTIME_DIR/heli3dof``, else ``$TMPDIR/heli3dof-UID``, else
  ``/tmp/heli3dof-UID``, the first that a socket's address has room for: locks and sockets of what
  runs now. Only its owner may enter (mode 0700): who can write there can stop a motor.
- state: ``$XDG_STATE_HOME/heli3dof``, else ``~/.local/state/heli3dof``: rest angles by serial
  number.
"""

from __future__ import annotations

import binascii
import errno
import os
import re
import stat
import sys
from pathlib import Path

from heli3dof.errors import DeviceError
from heli3dof.rig.url import DeviceUrl, parse_url

POSSIBLE = sys.platform != "win32"
"""Sessions need Unix sockets and locks; elsewhere the ports' own exclusive access has to do."""
LONGEST_SOCKET_PATH = 100
"""bytes; the address of a Unix socket holds 108, and 104 on some systems"""
LONGEST_NAME = 52
"""bytes of a file name in the runtime folder"""


def runtime_folder() -> Path:
    """The folder of running sessions, made where it is missing.

    Raises DeviceError where somebody else owns it: then nothing in it can be trusted.
    """
    given, temporary = os.environ.get("XDG_RUNTIME_DIR"), os.environ.get("TMPDIR")
    ours = f"heli3dof-{os.getuid()}"
    places = [Path(given) / "heli3dof"] if given and Path(given).is_dir() else []
    places += [Path(temporary) / ours] if temporary else []
    short = LONGEST_SOCKET_PATH - LONGEST_NAME
    folder = next((p for p in places if len(os.fsencode(p)) <= short), Path("/tmp") / ours)
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
    except OSError as problem:
        raise DeviceError(
            f"{folder} cannot be made: {problem.strerror}.",
            cause="without it no other terminal could stop the rig, so none is opened.",
            fix="set XDG_RUNTIME_DIR to a folder of your own",
        ) from problem
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
        raise DeviceError(
            f"{folder} belongs to somebody else.",
            cause="another user made it first; what it says of running rigs cannot be trusted.",
            fix=f"sudo rm -r {folder}, or set XDG_RUNTIME_DIR to a folder of your own",
        )
    if found.st_mode & 0o077:
        folder.chmod(0o700)
    return folder


def state_folder() -> Path:
    """The folder of what is kept from one session to the next; not made here.

    Raises OSError where the user has no home folder.
    """
    given = os.environ.get("XDG_STATE_HOME")
    if given:
        return Path(given) / "heli3dof"
    try:
        return Path.home() / ".local" / "state" / "heli3dof"
    except RuntimeError as error:
        raise OSError(
            errno.ENOENT, "there is no home folder: set HOME or XDG_STATE_HOME"
        ) from error


def device_name(device: str | DeviceUrl) -> str:
    """A file name for the rig that a URL names: the same for every way to write its place.

    Options do not count, and a link such as /dev/serial/by-id/… is followed to its port.

    >>> device_name("serial:///dev/null?baud=9600") == device_name("serial:///dev/null")
    True
    """
    url = parse_url(device) if isinstance(device, str) else device
    where = os.path.realpath(url.where) if url.where.startswith("/") else url.where
    readable = re.sub(r"[^A-Za-z0-9]+", "-", f"{url.scheme}-{where}").strip("-")[-24:]
    return f"{readable}-{binascii.crc32(f'{url.scheme}:{where}'.encode()):08x}"
