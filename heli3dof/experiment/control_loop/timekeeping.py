"""Keeps a flight's deadlines; measures how late each sample is and which periods were skipped.

A control period is skipped if the loop has no sample for it. There are three kinds:

* **missed**: the host requested or read the sample too late
* **lost**: the device took the sample, but the sample never arrived
* **device-skipped**: the device was busy and took no sample

Each sample k has an absolute deadline due[k] in s, where due[k+1] = due[k] + dt. The clock that
paces the rig (``Identity.timebase``) determines the deadlines:

=========  ==========================================  =========================================
timebase   due[k]                                      skipped periods
=========  ==========================================  =========================================
host       when the host should request sample k       ⌊lateness / dt⌋ before a late sample, all
                                                       of them missed
device     when sample k should arrive, estimated      see below
           from the device's clock (`ClockOffset`)
virtual    when sample k arrives                       none
=========  ==========================================  =========================================

With the device timebase, a link that numbers its samples counts all three kinds in
``rig.statistics``: ``lost``, ``device_skipped``, and for missed periods ``samples_stale`` (samples
that were outdated when the host read them). If the host discards more than `OVERFLOW` stale samples
before it uses a sample, its input buffer was full. A full buffer also loses samples. So the host
has caused these losses, and the lost periods before this sample count as missed.

If a link does not count all three kinds, the device's time in each sample shows how many periods
were skipped before the sample (`Instants`). No period then counts as device-skipped. Each skipped
period counts as lost or missed, by one of two rules:

* If the link counts lost samples, its count is the number of lost periods. The other skipped
  periods are missed.
* Otherwise let t be the time at which the host began to wait for the sample. A skipped period is
  lost if its deadline is later than t, and missed if it is earlier.

The plan's index k advances by skipped periods, too, so the references follow real time.

Lateness is the time from the first deadline that the host did not meet to the next sample. Example
for the host and the device timebase: the host stalls from due[k] until 5.5 dt later. It has missed
the five periods k to k + 4. The next sample is sample k + 5, and its lateness is 5.5 dt.
"""

from __future__ import annotations

from collections.abc import Callable
from operator import attrgetter
from typing import Any

from heli3dof.rig.clock import ClockOffset, Instants
from heli3dof.rig.interface import Rig, Sample
from heli3dof.rig.link_counters import attribute_of

OVERFLOW = 64
"""Number of samples that fit into any input buffer: 4096 bytes of a pseudo-terminal, at 49 bytes
each, minus a margin. If a host leaves more samples unread, the buffer may lose the next samples"""
Skipped = Callable[[], tuple[int, int, int]]
"""Returns the link's counters ``lost``, ``device_skipped`` and ``samples_stale``, in this order"""


class VirtualDeadlines:
    """Deadlines on a virtual clock, which advances with the samples: every sample is on time.

    `HostDeadlines` and `DeviceDeadlines`, the deadlines on a real clock, are derived from this
    class. They also compute how late a sample is, and which periods were skipped.
    """

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self.due = 0.0
        """Deadline of the next sample on the host's clock (s, monotonic), as estimated"""
        self.lateness = 0.0
        """s by which the last sample came after its deadline"""
        self.missed = 0
        """Periods skipped between the last two samples because the host was too late"""
        self.lost = 0
        """Periods skipped between the last two samples because samples were lost on the line"""
        self.device_skipped = 0
        """Periods skipped between the last two samples because the device was busy"""

    @property
    def skipped(self) -> int:
        """Return how many periods were skipped between the last two samples, for any reason."""
        return self.missed + self.lost + self.device_skipped

    def start(self, sample: Sample) -> None:
        self.due = sample.host_time_s

    def next(self) -> float:
        """Advance to the next period; return its deadline (s on the host's monotonic clock)."""
        self.due += self.dt
        return self.due

    def arrived(self, sample: Sample, since_s: float) -> None:
        """Update lateness and skipped periods with the sample that arrived.

        ``since_s``: when the host began to wait for this sample, in s (host's monotonic clock).
        """


class HostDeadlines(VirtualDeadlines):
    """Deadlines for a rig that takes sample k when the host requests the sample, at due[k] (s)."""

    def arrived(self, sample: Sample, since_s: float) -> None:
        self.lateness = sample.host_time_s - self.due
        self.missed = int(self.lateness / self.dt) if self.lateness > self.dt else 0
        self.due += self.missed * self.dt


class DeviceDeadlines(VirtualDeadlines):
    """Deadlines for a rig whose device sends sample k at time k·dt of the device's clock.

    ``lost``: returns how many samples the link has lost so far; None if the link does not count.
    """

    def __init__(self, dt: float, lost: Callable[[], int] | None = None) -> None:
        super().__init__(dt)
        self._counted = lost
        self._lost = 0
        """Samples that the link had lost when periods were last skipped"""

    def start(self, sample: Sample) -> None:
        self.due = sample.host_time_s
        self._instants = Instants(self.dt, sample.device_time_s)
        self._map = ClockOffset(sample.device_time_s, sample.host_time_s)
        self._lost = self._counted() if self._counted is not None else 0

    def arrived(self, sample: Sample, since_s: float) -> None:
        own = self._map.arrived(sample.device_time_s, sample.host_time_s)
        self.due = sample.host_time_s - own
        self._skip(sample, since_s)
        self.lateness = own + self.missed * self.dt

    def _skip(self, sample: Sample, since_s: float) -> None:
        skipped = self._instants.skipped(sample.device_time_s)
        self.missed = max(0, skipped - self._lost_since(since_s)) if skipped else 0
        self.lost = skipped - self.missed

    def _lost_since(self, since_s: float) -> int:
        if self._counted is None:
            return int(max(0.0, self.due - since_s) / self.dt)
        before, self._lost = self._lost, self._counted()
        return self._lost - before


class CountedDeadlines(DeviceDeadlines):
    """Deadlines for a rig whose link counts lost, device-skipped and stale samples separately."""

    def __init__(self, dt: float, skipped: Skipped) -> None:
        super().__init__(dt)
        self._so_far = skipped

    def start(self, sample: Sample) -> None:
        super().start(sample)
        self._before = self._so_far()

    def _skip(self, sample: Sample, since_s: float) -> None:
        before = self._before
        self._before = now = self._so_far()
        self.lost, self.device_skipped, self.missed = (
            now[0] - before[0], now[1] - before[1], now[2] - before[2],
        )  # fmt: skip
        if self.missed > OVERFLOW:
            self.missed, self.lost = self.missed + self.lost, 0


def timekeeper(rig: Rig, dt: float) -> VirtualDeadlines:
    """Return a new object that computes the deadlines and skipped periods of a flight on ``rig``.

    Its class depends on the clock that paces the rig (``Identity.timebase``). If this is the
    device's clock, the class also depends on whether the rig's link counts lost, device-skipped and
    stale (outdated) samples separately. ``dt``: control period in s.
    """
    if rig.identity.timebase == "host":
        return HostDeadlines(dt)
    if rig.identity.timebase == "virtual":
        return VirtualDeadlines(dt)
    counts: Any = getattr(rig, "statistics", None)
    lost, skipped, stale = (
        attribute_of(counts, name) for name in ("lost", "device_skipped", "samples_stale")
    )
    if lost and skipped and stale:
        read = attrgetter(lost, skipped, stale)
        return CountedDeadlines(dt, lambda: read(counts))
    return DeviceDeadlines(dt, (lambda: int(counts.lost)) if hasattr(counts, "lost") else None)
