"""Who keeps the time of a flight, and what that makes of a sample: on time, late, missed, lost.

Deadlines are absolute: due[k+1] = due[k] + dt, whatever happened in period k.

=========  ==============================  =====================================================
timebase   sample k is due                 periods that are skipped
=========  ==============================  =====================================================
host       when the host asks for it       ⌊lateness / dt⌋ where a sample came that late
device     by the device's clock, mapped   those by which the device's time jumped: *missed*
           to the host's (`ClockMap`)      where the host came too late to see them, *lost*
                                           where it was waiting and they did not come
virtual    when it comes                   none
=========  ==============================  =====================================================

A skipped period is never flown later: the plan's k moves past it, so references keep wall time.
Lateness counts from the first deadline that was not met: a host that was away for 5.5 periods is
late by 5.5 periods and has missed 5, whoever keeps the time.
"""

from __future__ import annotations

from typing import Protocol

from heli3dof.rig.clockmap import ClockMap
from heli3dof.rig.port import Identity, Sample


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

    def start(self, sample: Sample) -> None:
        self.due = sample.host_time_s
        self._t0, self._k = sample.device_time_s, 0
        self._map = ClockMap(sample.device_time_s, sample.host_time_s)

    def arrived(self, sample: Sample, asked_s: float) -> None:
        own = self._map.arrived(sample.device_time_s, sample.host_time_s)
        self.due = sample.host_time_s - own
        k = round((sample.device_time_s - self._t0) / self.dt)
        skipped, self._k = max(0, k - self._k - 1), k
        self.missed = 0
        if skipped:
            # Of the skipped ones, those that were due after the host began to wait are lost.
            lost = int(max(0.0, self.due - asked_s) / self.dt)
            self.missed = max(0, skipped - lost)
        self.lost = skipped - self.missed
        self.lateness = own + self.missed * self.dt


def timekeeper(identity: Identity, dt: float) -> Timekeeper:
    """The clock of a rig, for control periods of ``dt`` s."""
    kinds = {"host": HostTime, "device": DeviceTime, "virtual": VirtualTime}
    return kinds[identity.timebase](dt)
