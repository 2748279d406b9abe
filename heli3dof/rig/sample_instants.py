"""Counts the sampling instants that a device skipped, by the device's clock alone.

A device takes the sample of instant i at this instant or, when it is busy, a little later. So the
sample's time d on the device's clock determines i:

    t_0 + i·dt ≤ d < t_0 + (i + BUSY)·dt        t_0: time of instant 0, estimated

An instant without a sample was skipped. dt is the control period in s; BUSY and CREEP are fractions
of it. The estimate of t_0 is the smallest d − i·dt so far. It may rise by up to CREEP·dt per
sample, since the device's period may be longer than dt.
"""

from __future__ import annotations

BUSY = 0.9
"""periods: a sample that is later than this after an instant belongs to the next one"""
CREEP = 1e-3
"""Largest excess of the device's period over dt, as a share of dt"""


class Instants:
    """Counts a device's sampling instants: the first at ``first_s`` (s), then every ``dt`` s."""

    def __init__(
        self, dt: float, first_s: float, *, busy: float = BUSY, creep: float = CREEP
    ) -> None:
        self._dt, self._busy, self._creep = dt, busy, creep * dt
        self._base, self._k = first_s, 0

    def skipped(self, device_s: float) -> int:
        """Add a sample taken at ``device_s`` s; return the number of instants skipped before it."""
        dt = self._dt
        behind = (device_s - self._base) / dt - (self._k + 1)
        skipped = max(0, int(behind + 1 - self._busy))
        self._k += 1 + skipped
        self._base = min(self._base + self._creep, device_s - self._k * dt)
        return skipped
