"""A port that another process holds, opened without pyserial's lock to stop the rig.

The port's settings are the holder's own and right: they stay untouched.
"""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from .descriptor_line import DescriptorLine
from .serial_line import refused

if TYPE_CHECKING:
    from .transport import Transport


def open_beside(path: str) -> Transport:
    """The port with its holder. Raises DeviceError: missing or not permitted."""
    try:
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as problem:
        raise refused(path, problem) from problem
    return DescriptorLine(fd, path, lambda: os.close(fd))
