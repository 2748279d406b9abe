"""Returns the folders of this user's sessions and calibrations, and file names for a device.

The runtime folder contains the locks and the files of running sessions. Its mode is 0700, because a
process that can read these files can stop the motors. The state folder contains the encoder counts
at rest of each serial number, and the device URLs at which rigs were opened (`known_devices`). The
paths in the column "first choice" apply if their variable is set. Otherwise the path depends on the
operating system:

=======  =============================  ==============================  ==========================
folder   first choice                   Linux, macOS                    Windows
=======  =============================  ==============================  ==========================
runtime  ``$XDG_RUNTIME_DIR/heli3dof``  ``$TMPDIR/heli3dof-UID``, else  ``%TEMP%\\heli3dof``
                                        ``/tmp/heli3dof-UID``
state    ``$XDG_STATE_HOME/heli3dof``   ``~/.local/state/heli3dof``     ``%LOCALAPPDATA%\\heli3dof``
=======  =============================  ==============================  ==========================

UID is the user's number.
"""

from __future__ import annotations

import binascii
import errno
import os
import re
import stat
import tempfile
from pathlib import Path

from heli3dof.errors import DeviceError, quoted
from heli3dof.rig.url import DeviceUrl, parse_url


def runtime_folder() -> Path:
    """Return the folder of running sessions; create it if it is missing.

    Raises DeviceError if another user owns the folder: its content cannot be trusted.
    """
    given = os.environ.get("XDG_RUNTIME_DIR")
    user = (
        os.getuid() if hasattr(os, "getuid") else None
    )  # None: Windows, where the folder is the user's
    if given and Path(given).is_dir():
        folder = Path(given) / "heli3dof"
    else:
        name = "heli3dof" if user is None else f"heli3dof-{user}"
        folder = Path(tempfile.gettempdir()) / name
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        status = folder.lstat()
    except OSError as problem:
        raise DeviceError(
            f"{folder} cannot be created: {problem.strerror}.",
            cause="without it no other terminal could stop the rig, so no rig is opened.",
            fix="set XDG_RUNTIME_DIR to a folder of your own",
        ) from problem
    if user is None:
        return folder
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != user:
        raise DeviceError(
            f"{folder} belongs to another user.",
            cause="another user created it first; its content cannot be trusted.",
            fix=f"sudo rm -r {quoted(folder)}, or set XDG_RUNTIME_DIR to a folder of your own",
        )
    if status.st_mode & 0o077:
        folder.chmod(0o700)
    return folder


def state_folder() -> Path:
    """Return the folder of the files kept between sessions; it may not exist yet.

    Raises OSError for a user without a home folder.
    """
    given = os.environ.get("XDG_STATE_HOME")
    if os.name == "nt":
        given = given or os.environ.get("LOCALAPPDATA")
    if given:
        return Path(given) / "heli3dof"
    try:
        return Path.home() / ".local" / "state" / "heli3dof"
    except RuntimeError as error:
        raise OSError(
            errno.ENOENT, "there is no home folder: set HOME or XDG_STATE_HOME"
        ) from error


def device_name(device: str | DeviceUrl) -> str:
    """Return a file name for the rig at a device URL, the same for every spelling of the URL.

    The URL's options are left out, and a link such as /dev/serial/by-id/… is resolved.

    >>> device_name("serial:///dev/null?baud=9600") == device_name("serial:///dev/null")
    True
    """
    url = parse_url(device) if isinstance(device, str) else device
    where = os.path.realpath(url.where) if url.where.startswith("/") else url.where
    readable = re.sub(r"[^A-Za-z0-9]+", "-", f"{url.scheme}-{where}").strip("-")[-24:]
    return f"{readable}-{binascii.crc32(f'{url.scheme}:{where}'.encode()):08x}"
