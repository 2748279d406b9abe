"""Waits for a deadline; estimates the device's clock and counts its sampling instants.

Clock offset: a sample taken at device time d arrives at host time h = d + θ + w. θ is the offset
between the clocks, w ≥ 0 the transport delay. The smallest h − d so far is the best estimate of θ.
Clocks drift, so the estimate may rise again, at the rate `DRIFT` at most:

    θ[k] = min(h[k] − d[k],  θ[k−1] + DRIFT · (d[k] − d[k−1]))
    lateness[k] = h[k] − (d[k] + θ[k]) ≥ 0

k numbers the samples; all times are in s. The estimate of θ includes the smallest transport
delay; lateness is the delay beyond it. A delayed sample raises the estimate at the rate `DRIFT` at
most. So the estimate follows a device clock that is up to 100 ppm slow, and any clock that is fast.

Sampling instants: a device takes the sample of instant i at this instant or, when it is busy, a
little later. So the sample's time d on the device's clock determines i:

    t_0 + i·dt ≤ d < t_0 + (i + BUSY)·dt        t_0: time of instant 0, estimated

An instant without a sample was skipped. dt is the control period in s; BUSY and CREEP are fractions
of it. The estimate of t_0 is the smallest d − i·dt so far. It may rise by up to CREEP·dt per
sample, since the device's period may be longer than dt.

Uptime: the time since the device started, which it counts in ms modulo 2³².
"""

from __future__ import annotations

import time

LATE_S = 1e-3
"""s after its deadline from which a sample or a wake-up is reported as late: half a period at
500 Hz. The safety monitor of late samples has a limit of its own, ``limits.late_max_s``"""
SPIN_S = 200e-6
"""s before the deadline at which polling starts: a sleep overshoots by about this much"""
DRIFT = 100e-6
"""s per s: largest difference in rate between two crystal clocks"""
BUSY = 0.9
"""periods: a sample taken more than this after an instant belongs to the next instant"""
CREEP = 1e-3
"""Largest excess of the device's period over dt, as a share of dt"""
UPTIME_WRAP_S = 2**32 / 1000
"""s after which the uptime starts again at zero: 49.7 days (docs/reference/protocol.md, REPORT)"""
CLOCK_TOLERANCE = 5e-3
"""s per s: error of the worst clock of a microcontroller board, a ceramic resonator (0.5 %)"""


def wait_until(due_s: float) -> float:
    """Wait until the time ``due_s`` (s, `time.monotonic`); return the time after the wait, in s."""
    now = time.monotonic()
    while (left := due_s - now) > 0:
        if left > SPIN_S:
            time.sleep(left - SPIN_S)
        now = time.monotonic()
    return now


class ClockOffset:
    """Estimates the offset θ = host's time − device's time in s, for one device's clock."""

    def __init__(self, device_s: float, host_s: float) -> None:
        """Start with the first sample, taken at ``device_s``, which arrived at ``host_s``.

        Both in s: ``device_s`` on the device's clock, ``host_s`` on the host's monotonic clock.
        """
        self._device = device_s
        self._offset = host_s - device_s

    def host(self, device_s: float) -> float:
        """Return when a sample taken at ``device_s`` should arrive: ``device_s`` + θ.

        ``device_s`` is in s on the device's clock, the result in s on the host's monotonic clock.
        θ: the estimated offset between the clocks.
        """
        return device_s + self._offset

    def arrived(self, device_s: float, host_s: float) -> float:
        """Add a sample taken at ``device_s`` that arrived at ``host_s``; return its lateness in s.

        Lateness: time from the expected arrival (`host`) to ``host_s``; never negative.
        ``device_s`` is in s on the device's clock, ``host_s`` in s on the host's monotonic clock.
        """
        drifted = self._offset + DRIFT * max(0.0, device_s - self._device)
        self._device = device_s
        self._offset = min(host_s - device_s, drifted)
        return host_s - device_s - self._offset


class Instants:
    """Counts a device's sampling instants: the first at ``first_s`` (s), then every ``dt`` s.

    ``busy``: largest delay of a sample after its instant. ``creep``: largest excess of the device's
    period over ``dt``. Both are fractions of ``dt``.
    """

    def __init__(
        self, dt: float, first_s: float, *, busy: float = BUSY, creep: float = CREEP
    ) -> None:
        self._dt, self._busy, self._creep = dt, busy, creep * dt
        self._base, self._k = first_s, 0

    def skipped(self, device_s: float) -> int:
        """Add a sample; return how many sampling instants since the previous sample have no sample.

        ``device_s``: when the sample was taken, in s on the device's clock.
        """
        dt = self._dt
        behind = (device_s - self._base) / dt - (self._k + 1)
        skipped = max(0, int(behind + 1 - self._busy))
        self._k += 1 + skipped
        self._base = min(self._base + self._creep, device_s - self._k * dt)
        return skipped


def wrapped_difference_s(a_s: float, b_s: float) -> float:
    """Return the difference a_s − b_s of two uptimes, in s modulo W, within [−W/2, W/2).

    >>> wrapped_difference_s(1.0, UPTIME_WRAP_S - 1.0)
    2.0

    W = `UPTIME_WRAP_S`: the uptime in s at which the device's counter starts again from 0.
    """
    half_s = UPTIME_WRAP_S / 2
    return (a_s - b_s + half_s) % UPTIME_WRAP_S - half_s
