"""A port that another process may hold, opened beside it to stop the rig.

The descriptor is taken without pyserial's lock. Where another process holds that lock, the port's
settings are its own and right; they are touched only where nobody does.
"""

from __future__ import annotations

import fcntl
import os
from typing import TYPE_CHECKING

from .descriptor_line import DescriptorLine
from .serial_line import BAUD, open_line, refused

if TYPE_CHECKING:
    from .transport import Transport


def is_held(fd: int) -> bool:
    """True when another process has locked this port, as every pyserial program of ours does."""
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return True
    fcntl.flock(fd, fcntl.LOCK_UN)
    return False


def open_second_hand(path: str, *, baud: int = BAUD) -> Transport:
    """The port, whoever holds it. Raises DeviceError: missing or not permitted."""
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as problem:
        raise refused(path, problem) from problem
    if is_held(fd):
        return DescriptorLine(fd, path, lambda: os.close(fd))
    os.close(fd)
    return open_line(path, baud=baud)
