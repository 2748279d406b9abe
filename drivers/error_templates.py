"""Error tables: each maps a library's error number to a message, its cause and the fix.

The texts are templates. ``{name}`` is the rig's URL, ``{doing}`` the operation that failed. The
driver fills them in, and further fields that its own table uses.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from heli3dof.errors import DeviceError


class ErrorTemplate(NamedTuple):
    """The texts of an error: what happened, its cause and the fix, with ``{fields}`` to fill in."""

    what: str
    cause: str
    fix: str

    def error(self, **fields: object) -> DeviceError:
        """Returns the error with ``fields`` filled into its texts."""
        what, cause, fix = (text.format(**fields) for text in self)
        return DeviceError(what, cause=cause, fix=fix)


ErrorTable = Mapping[int, ErrorTemplate]


def each(numbers: Iterable[int], template: ErrorTemplate) -> dict[int, ErrorTemplate]:
    """Returns a table that gives each of these error numbers the same template."""
    return dict.fromkeys(numbers, template)
