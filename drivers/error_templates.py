"""Error tables: each maps a library's error number to a message, its cause and the fix.

The texts are templates. ``{name}`` stands for the rig's URL, ``{doing}`` for the operation that
failed. The driver fills in these fields, and further ones that only its own table uses.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from heli3dof.errors import DeviceError


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
