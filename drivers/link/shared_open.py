"""Opens a port that another process has locked, to stop the rig.

The port is opened without pyserial's lock. Its settings stay as the holder has set them.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from .descriptor_line import DescriptorLine
from .serial_line import refused

if TYPE_CHECKING:
    from .transport import Transport


def open_shared(path: str) -> Transport | None:
    """The port, shared with its holder; None where no process holds it, and on Windows.

    Raises DeviceError: missing or not permitted.
    """
    if os.name != "posix":
        return None
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as problem:
        raise refused(path, problem) from problem
    if _is_locked(fd):
        return DescriptorLine(fd, path, lambda: os.close(fd))
    os.close(fd)
    return None


def _is_locked(fd: int) -> bool:
    """True when another process has locked the port, as every heli3dof process does."""
    import fcntl

    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False
