"""Errors that a library reports by number, as a table: number → message, cause and fix.

The texts are templates. ``{name}`` is the rig's URL, ``{doing}`` the operation that failed; a
table may use further fields, which its driver fills in.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from heli3dof.errors import DeviceError


class ErrorTemplate(NamedTuple):
    """The three sentences of an error with fields to fill in."""

    what: str
    cause: str
    fix: str

    def error(self, **fields: object) -> DeviceError:
        """The error with its fields filled in."""
        what, cause, fix = (text.format(**fields) for text in self)
        return DeviceError(what, cause=cause, fix=fix)


ErrorTable = Mapping[int, ErrorTemplate]


def each(numbers: Iterable[int], template: ErrorTemplate) -> dict[int, ErrorTemplate]:
    """Several numbers with the same meaning."""
    return dict.fromkeys(numbers, template)
