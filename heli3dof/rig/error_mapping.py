"""What goes wrong at a line or in a vendor's library, said as a driver owes it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from heli3dof.errors import DeviceError


@contextmanager
def device_errors(name: str, fix: str = "heli3dof doctor", cause: str = "") -> Iterator[None]:
    """Every OSError and ValueError within becomes a DeviceError about the rig ``name``.

    ``fix``: the command to run, or the thing to do; ``cause``: the likely one.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        said = str(error).strip().rstrip(".") or type(error).__name__
        raise DeviceError(
            f"{name}: {said}.",
            cause=cause or "it is switched off, out of reach, or held by another program.",
            fix=fix,
        ) from error
