"""Turn the errors of a port or a vendor's library into DeviceError."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from heli3dof.errors import DeviceError


@contextmanager
def device_errors(name: str, fix: str = "heli3dof doctor", cause: str = "") -> Iterator[None]:
    """Context manager: raise OSError and ValueError as a DeviceError about the device ``name``.

    ``cause``, ``fix``: texts of the DeviceError, the likely cause and what to do.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        message = str(error).strip().rstrip(".") or type(error).__name__
        raise DeviceError(
            f"{name}: {message}.",
            cause=cause or "it is switched off, out of reach, or held by another program.",
            fix=fix,
        ) from error
