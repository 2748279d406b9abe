"""The instant of a stream that a sample belongs to, by the device's clock alone.

A device takes a sample at its instant, or a little later when it is busy, never earlier:

    sample of instant i:  base + i·dt ≤ d < base + (i + 1)·dt

So base is the earliest value that fits. It may creep, since dt need not be exactly the device's own
period (whole µs, on its own crystal).
"""

from __future__ import annotations

BUSY = 0.9
"""periods: a sample that is later than this belongs to the next instant"""
CREEP = 1e-3
"""periods per period: by how much the device's period may exceed dt"""


class Instants:
    """Counts a stream's instants from its first sample on; times in seconds."""

    def __init__(
        self, dt: float, first_s: float, *, busy: float = BUSY, creep: float = CREEP
    ) -> None:
        self._dt, self._busy, self._creep = dt, busy, creep * dt
        self._base, self._k = first_s, 0

    def skipped(self, device_s: float) -> int:
        """Add the next sample; returns the number of instants without a sample before it."""
        dt = self._dt
        behind = (device_s - self._base) / dt - (self._k + 1)
        skipped = max(0, int(behind + 1 - self._busy))
        self._k += 1 + skipped
        self._base = min(self._base + self._creep, device_s - self._k * dt)
        return skipped
