"""The interface of what carries the link's bytes: a serial line, USB pipes, an emulated rig.

A transport knows nothing of frames. It raises DeviceError where it is unplugged, not permitted or
full.
"""

from __future__ import annotations

from typing import Protocol


class Transport(Protocol):
    """An open line to one device. Every method but ``close`` may raise DeviceError."""

    @property
    def name(self) -> str:
        """Its name in messages: a port, a USB path."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """The bytes that have arrived, at least one; b"" when none arrived within ``timeout_s``."""
        ...

    def flush_input(self) -> None:
        """Discard the bytes that have arrived."""
        ...

    def close(self) -> None:
        """Release the line. Idempotent; never raises."""
        ...
