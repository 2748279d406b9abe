"""Which instant of a stream a sample belongs to, by the device's clock alone.

    sample of instant i:  base + i·dt ≤ d < base + (i + 1)·dt

Samples are taken at their instants, or a little after where the device was busy; never before. So
base is the earliest that fits. It may creep, where dt is not exactly the device's own period (one
of whole µs, on a crystal of its own).
"""

from __future__ import annotations

BUSY = 0.9
"""Of a period: by how much a device may take a sample too late before it is the next one's"""
CREEP = 1e-3
"""Of a period, in each: how much longer the device's may be"""


class Instants:
    """Counts a stream's instants from its first sample on; times in seconds."""

    def __init__(
        self, dt: float, first_s: float, *, busy: float = BUSY, creep: float = CREEP
    ) -> None:
        self._dt, self._busy, self._creep = dt, busy, creep * dt
        self._base, self._k = first_s, 0

    def skipped(self, device_s: float) -> int:
        """Take in the next sample; whole periods by which the time jumped beyond one."""
        dt = self._dt
        behind = (device_s - self._base) / dt - (self._k + 1)
        skipped = max(0, int(behind + 1 - self._busy))
        self._k += 1 + skipped
        self._base = min(self._base + self._creep, device_s - self._k * dt)
        return skipped
