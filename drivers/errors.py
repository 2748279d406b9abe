"""Errors of several drivers: their common texts, and tables of a library's error numbers.

A table maps each error number to a message, its cause and the fix. These texts are templates:
``{name}`` stands for the rig's URL, ``{doing}`` for the operation that failed. The driver fills in
these fields, and further ones that only its own table uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from heli3dof.errors import DeviceError, UsageError


class ErrorTemplate(NamedTuple):
    """Texts of an error: message, cause and fix, with fields such as ``{name}`` to fill in."""

    what: str
    cause: str
    fix: str

    def error(self, **fields: object) -> DeviceError:
        """Return a DeviceError with these texts, in which ``fields`` replace each ``{…}``."""
        what, cause, fix = (text.format(**fields) for text in self)
        return DeviceError(what, cause=cause, fix=fix)


ErrorTable = Mapping[int, ErrorTemplate]


def closed(name: str) -> DeviceError:
    return DeviceError(
        f"{name} is closed.",
        cause="close() was called before.",
        fix="open it again with heli3dof.open_rig",
    )


def not_armed(name: str) -> DeviceError:
    return DeviceError(
        f"{name} is not armed: no voltage was sent.",
        cause="exchange() was called before arm().",
        fix="call arm() first; it returns the first sample",
    )


def not_a_voltage(sequence: int, v_front: float, v_back: float) -> DeviceError:
    return DeviceError(
        f"Command {sequence} is not a voltage: {v_front}, {v_back}.",
        cause="the controller's output is not finite; the motors were stopped.",
        fix="check the gains and references of this run",
    )


def watchdog_too_short(watchdog_s: float, dt: float) -> UsageError:
    return UsageError(
        f"watchdog_s={watchdog_s:g} is shorter than two control periods of {dt:g} s.",
        cause="the watchdog would expire between two commands.",
        fix=f"watchdog_s={3 * dt:g} or more",
    )
