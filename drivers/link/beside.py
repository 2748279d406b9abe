"""A port that another process holds, opened beside it to stop the rig.

The descriptor is taken without pyserial's lock. The port's settings are the holder's own and
right: they stay untouched.
"""

from __future__ import annotations

import fcntl
import os
from typing import TYPE_CHECKING

from .descriptor_line import DescriptorLine
from .serial_line import refused

if TYPE_CHECKING:
    from .transport import Transport


def open_beside(path: str) -> Transport | None:
    """The port beside its holder; None when nobody holds it.

    Raises DeviceError: missing or not permitted.
    """
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as problem:
        raise refused(path, problem) from problem
    if _is_locked(fd):
        return DescriptorLine(fd, path, lambda: os.close(fd))
    os.close(fd)
    return None


def _is_locked(fd: int) -> bool:
    """True when another process has locked the port, as every pyserial program of ours does."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False
