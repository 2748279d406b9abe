"""Who keeps the time of a flight, and what that makes of a sample: on time, late, missed, lost.

Deadlines are absolute: due[k+1] = due[k] + dt, whatever happened in period k.

=========  ==============================  =====================================================
timebase   sample k is due                 periods that are skipped
=========  ==============================  =====================================================
host       when the host asks for it       ⌊lateness / dt⌋ where a sample came that late
device     by the device's clock, mapped   those by which the device's time jumped: *lost*
           to the host's (`ClockMap`)      where the link says so, *missed* by the host else
virtual    when it comes                   none
=========  ==============================  =====================================================

A skipped period is never flown later: the plan's k moves past it, so references keep wall time.
Lateness counts from the first deadline that was not met: a host that was away for 5.5 periods is
late by 5.5 periods and has missed 5, whoever keeps the time. A link tells what it has lost by
``rig.statistics.lost``; of one that does not, a skipped sample is lost that was due after the host
began to wait.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from heli3dof.rig.clockmap import ClockMap
from heli3dof.rig.port import Rig, Sample

BUSY = 0.9
"""Of a period: by how much a device may take a sample too late before it is the next one's"""
CREEP = 1e-3
"""Of a period, in each: how much longer the device's may be"""


class Timekeeper(Protocol):
    """What the loop asks of a clock."""

    due: float
    """Host time of the next sample's deadline, as far as it is known (s, monotonic)"""
    lateness: float
    """s by which the last sample was late"""
    missed: int
    """Periods skipped before it because the host was late"""
    lost: int
    """Periods skipped before it because their samples never came"""

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
        self.missed = self.lost = 0

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
        self._base, self._k = sample.device_time_s, 0
        self._map = ClockMap(sample.device_time_s, sample.host_time_s)
        self._lost = self._counted() if self._counted is not None else 0

    def arrived(self, sample: Sample, asked_s: float) -> None:
        own = self._map.arrived(sample.device_time_s, sample.host_time_s)
        self.due = sample.host_time_s - own
        skipped = self._skipped(sample.device_time_s)
        self.missed = 0
        if skipped:
            self.missed = max(0, skipped - self._lost_since(asked_s))
        self.lost = skipped - self.missed
        self.lateness = own + self.missed * self.dt

    def _skipped(self, device_s: float) -> int:
        """Whole periods that the device's time jumped by.

        Samples are taken at base + k·dt, or a little after it where the device was busy; never
        before. So base is the earliest that fits, and may creep (a period in whole µs is not dt).
        """
        dt = self.dt
        behind = (device_s - self._base) / dt - (self._k + 1)
        skipped = max(0, int(behind + 1 - BUSY))
        self._k += 1 + skipped
        self._base = min(self._base + CREEP * dt, device_s - self._k * dt)
        return skipped

    def _lost_since(self, asked_s: float) -> int:
        if self._counted is None:
            return int(max(0.0, self.due - asked_s) / self.dt)
        before, self._lost = self._lost, self._counted()
        return self._lost - before


def timekeeper(rig: Rig, dt: float) -> Timekeeper:
    """The clock of a rig, for control periods of ``dt`` s."""
    if rig.identity.timebase == "host":
        return HostTime(dt)
    if rig.identity.timebase == "virtual":
        return VirtualTime(dt)
    statistics: Any = getattr(rig, "statistics", None)
    counted = hasattr(statistics, "lost")
    return DeviceTime(dt, (lambda: int(statistics.lost)) if counted else None)
