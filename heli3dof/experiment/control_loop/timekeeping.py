"""Who keeps the time of a flight, and what that makes of a sample: on time, late, or skipped.

Deadlines are absolute: due[k+1] = due[k] + dt, whatever happened in period k.

=========  ==============================  ====================================================
timebase   sample k is due                 periods that are skipped
=========  ==============================  ====================================================
host       when the host asks for it       ⌊lateness / dt⌋ where a sample came that late: missed
device     by the device's clock, mapped   those that the link counted, or by which the
           to the host's (`ClockMap`)      device's time jumped (`Instants`)
virtual    when it comes                   none
=========  ==============================  ====================================================

A link that numbers its samples tells the device's skipped periods apart (``rig.statistics``): those
*lost* were made and never came, those *left out* were never made, for the device itself was held
up, and those *passed over* came too late to be flown: the host *missed* them. Of a link that counts
less, the device's time tells how many were skipped; those are lost that it counts as lost, or
that were due after the host began to wait; the rest is missed.

A skipped period is never flown later: the plan's k moves past it, so references keep wall time.
Lateness counts from the first deadline that the host did not meet: a host that was away for 5.5
periods is late by 5.5 periods and has missed 5, whoever keeps the time.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any, Protocol

from heli3dof.rig.clock_offset import ClockMap
from heli3dof.rig.interface import Rig, Sample
from heli3dof.rig.link_counters import attribute_of
from heli3dof.rig.sample_instants import Instants

Skipped = Callable[[], tuple[int, int, int]]
"""Samples that a link has lost, its device left out, its host passed over: since it was opened"""


class Timekeeper(Protocol):
    """What the loop asks of a clock."""

    due: float
    """Host time of the next sample's deadline, as far as it is known (s, monotonic)"""
    lateness: float
    """s by which the last sample was late"""
    missed: int
    """Periods skipped before it because the host was late"""
    lost: int
    """Periods skipped before it because their samples were lost on the line"""
    left_out: int
    """Periods skipped before it because the device made no samples of them"""

    def start(self, sample: Sample) -> None:
        """The flight begins with this sample."""
        ...

    def next(self) -> float:
        """Move to the next period; its deadline."""
        ...

    def arrived(self, sample: Sample, asked_s: float) -> None:
        """Judge the period's sample, which the host began to wait for at ``asked_s``."""
        ...


class VirtualTime:
    """The clock runs as the host asks: nothing can be late."""

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self.due = self.lateness = 0.0
        self.missed = self.lost = self.left_out = 0

    def start(self, sample: Sample) -> None:
        self.due = sample.host_time_s

    def next(self) -> float:
        self.due += self.dt
        return self.due

    def arrived(self, sample: Sample, asked_s: float) -> None:
        pass


class HostTime(VirtualTime):
    """The host asks for sample k at due[k]."""

    def arrived(self, sample: Sample, asked_s: float) -> None:
        self.lateness = sample.host_time_s - self.due
        self.missed = int(self.lateness / self.dt) if self.lateness > self.dt else 0
        self.due += self.missed * self.dt


class DeviceTime(VirtualTime):
    """The device sends sample k at its own k·dt."""

    def __init__(self, dt: float, lost: Callable[[], int] | None = None) -> None:
        super().__init__(dt)
        self._counted = lost
        self._lost = 0
        """What the link had lost so far"""

    def start(self, sample: Sample) -> None:
        self.due = sample.host_time_s
        self._instants = Instants(self.dt, sample.device_time_s)
        self._map = ClockMap(sample.device_time_s, sample.host_time_s)
        self._lost = self._counted() if self._counted is not None else 0

    def arrived(self, sample: Sample, asked_s: float) -> None:
        own = self._map.arrived(sample.device_time_s, sample.host_time_s)
        self.due = sample.host_time_s - own
        self._skip(sample, asked_s)
        self.lateness = own + self.missed * self.dt

    def _skip(self, sample: Sample, asked_s: float) -> None:
        skipped = self._instants.skipped(sample.device_time_s)
        self.missed = max(0, skipped - self._lost_since(asked_s)) if skipped else 0
        self.lost = skipped - self.missed

    def _lost_since(self, asked_s: float) -> int:
        if self._counted is None:
            return int(max(0.0, self.due - asked_s) / self.dt)
        before, self._lost = self._lost, self._counted()
        return self._lost - before


class CountedTime(DeviceTime):
    """The same, over a link that says what became of every sample."""

    def __init__(self, dt: float, skipped: Skipped) -> None:
        super().__init__(dt)
        self._so_far = skipped

    def start(self, sample: Sample) -> None:
        super().start(sample)
        self._before = self._so_far()

    def _skip(self, sample: Sample, asked_s: float) -> None:
        before = self._before
        self._before = now = self._so_far()
        self.lost, self.left_out, self.missed = (
            now[0] - before[0], now[1] - before[1], now[2] - before[2],
        )  # fmt: skip


def timekeeper(rig: Rig, dt: float) -> Timekeeper:
    """The clock of a rig, for control periods of ``dt`` s."""
    if rig.identity.timebase == "host":
        return HostTime(dt)
    if rig.identity.timebase == "virtual":
        return VirtualTime(dt)
    counts: Any = getattr(rig, "statistics", None)
    lost, skipped, stale = (
        attribute_of(counts, name) for name in ("lost", "device_skipped", "samples_stale")
    )
    if lost and skipped and stale:
        read = attrgetter(lost, skipped, stale)
        return CountedTime(dt, lambda: read(counts))
    return DeviceTime(dt, (lambda: int(counts.lost)) if hasattr(counts, "lost") else None)
