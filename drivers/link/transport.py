"""Interface of a transport, which carries the link's bytes: a serial line or USB pipes.

A transport does not interpret the bytes. It raises DeviceError if it is unplugged, not permitted,
or accepts no more bytes.
"""

from __future__ import annotations

from typing import Protocol


class Transport(Protocol):
    """An open connection to one device. Every method but ``close`` may raise DeviceError."""

    @property
    def name(self) -> str:
        """Return the connection's name for messages: a port or a URL."""
        ...

    def write(self, data: bytes) -> None:
        """Send all of ``data``."""
        ...

    def read(self, timeout_s: float) -> bytes:
        """Return the bytes that have arrived; b"" if none arrive within ``timeout_s`` seconds."""
        ...

    def flush_input(self) -> None:
        """Discard the bytes that have arrived from the device and were not read yet."""
        ...

    def close(self) -> None:
        """Close the connection. Never raises an error; a second call does nothing."""
        ...
