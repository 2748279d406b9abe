"""Errors that a library reports by number, as a table: number → what it means at the rig.

The texts are templates: ``{name}`` is the rig's URL, ``{doing}`` what was being done; a table may
ask for more words, which its driver then gives.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from heli3dof.errors import DeviceError


class Trouble(NamedTuple):
    """The three sentences of an error, before its words are put in."""

    what: str
    cause: str
    fix: str

    def error(self, **words: object) -> DeviceError:
        """The error for a user."""
        what, cause, fix = (text.format(**words) for text in self)
        return DeviceError(what, cause=cause, fix=fix)


Troubles = Mapping[int, Trouble]


def each(numbers: Iterable[int], trouble: Trouble) -> dict[int, Trouble]:
    """Several numbers that mean the same."""
    return dict.fromkeys(numbers, trouble)
