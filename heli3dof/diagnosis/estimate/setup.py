"""What is diagnosed, and how: the recordings, the random seed, the number of simulated flights."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from heli3dof.axes import AXES
from heli3dof.identification.row_selection import unusable
from heli3dof.recording.recording import Recording

FALSE_ALARMS = 0.003
"""The share of recordings with nothing to find in which something is found."""


@dataclass(frozen=True)
class Setup:
    """What is diagnosed, and with how many pilot flights."""

    recordings: tuple[Recording, ...]
    seed: int
    pilots: int
    base: str = "rigid"
    """One of `estimate.base_fit.BASES`"""
    opinions: bool = True
    """Whether modest scores ask a second one (`selection.rivals`), some seconds each"""

    @property
    def controller_is_known(self) -> bool:
        return controller_is_known(self.recordings)

    @cached_property
    def touches_stops(self) -> bool:
        """Whether a stop held the arm: flights of a fit know of none, and need not stay near."""
        return any(unusable(r)["stop"].any() for r in self.recordings)

    @property
    def axes(self) -> list[str]:
        return [a for a in AXES if any(a in r.axes for r in self.recordings)]


def controller_is_known(recordings: Sequence[Recording]) -> bool:
    """True where every recording can be flown again."""
    return all(
        r.profile.controller_is_known
        and len(r.axes) == 3
        and any(r.has_reference(a) for a in r.axes)
        for r in recordings
    )
