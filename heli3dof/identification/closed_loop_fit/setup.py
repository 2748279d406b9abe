"""Settings of a fit that simulates flights: recordings, random seed, number of flights."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from heli3dof.axes import AXES
from heli3dof.identification.row_selection import unusable
from heli3dof.model.control.voltage_replay import controller_is_known
from heli3dof.recording.recording import Recording


@dataclass(frozen=True)
class Setup:
    """The settings of a diagnosis, or of another fit that simulates flights."""

    recordings: tuple[Recording, ...]
    seed: int
    flights_per_round: int
    """Flights simulated per iteration of the bias correction"""
    base: str = "rigid"
    """Name of the base simulation, a key of `closed_loop_fit.base_fit.BASES`"""
    refuted: tuple[str, ...] = ()
    """Names of terms that are no candidates: an earlier search dropped them"""

    @property
    def controller_is_known(self) -> bool:
        return controller_is_known(self.recordings)

    @cached_property
    def touches_stops(self) -> bool:
        """Return True if an axis touched a mechanical stop. Simulated flights have no stops."""
        return any(unusable(r)["stop"].any() for r in self.recordings)

    @property
    def axes(self) -> list[str]:
        return [a for a in AXES if any(a in r.axes for r in self.recordings)]

    @property
    def explained_axes(self) -> list[str]:
        """Return the measured axes on which a diagnosis can name effects.

        Yaw is among them only if pitch was measured, because the thrust component that turns yaw is
        proportional to sin(pitch).
        """
        return [a for a in self.axes if a != "yaw" or "pitch" in self.axes]
