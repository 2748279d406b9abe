"""Interface of a transport, which carries the link's bytes: a serial line, USB pipes.

A transport does not interpret the bytes. It raises DeviceError where it is unplugged, not permitted
or full.
"""

from __future__ import annotations

from typing import Protocol


class Transport(Protocol):
    """An open line to one device. Every method but ``close`` may raise DeviceError."""

    @property
    def name(self) -> str:
        """The line's name in messages: a port, a USB path."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Returns the bytes that have arrived; b"" when none arrived within ``timeout_s``."""
        ...

    def flush_input(self) -> None:
        """Discard the bytes that have arrived."""
        ...

    def close(self) -> None:
        """Release the line. Idempotent; never raises."""
        ...
