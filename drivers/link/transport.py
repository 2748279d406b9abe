"""What carries the link's bytes: a serial line, a USB pipe, an emulated rig in the same process.

A transport knows nothing of frames. What it cannot do is a DeviceError that says so: unplugged,
not permitted, full.
"""

from __future__ import annotations

from typing import Protocol


class Transport(Protocol):
    """An open line to one device. Every method but ``close`` may raise DeviceError."""

    @property
    def name(self) -> str:
        """What the user calls it, for messages: a port, a USB path."""
        ...

    def write(self, data: bytes) -> None:
        """All of ``data``, or DeviceError."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """What is there; waits until there is at least one byte, or b"" after ``timeout_s``."""
        ...

    def flush_input(self) -> None:
        """Forget what has arrived and was not read."""
        ...

    def close(self) -> None:
        """Release the line. Idempotent; never raises."""
        ...
