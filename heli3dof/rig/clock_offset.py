"""Estimates the offset between the device's and the host's clock, and each sample's lateness.

A sample taken at device time d arrives at host time h = d + θ + w. θ is the offset between the
clocks, w ≥ 0 the transport delay. The smallest h − d so far is the best estimate of θ. Clocks
drift, so the estimate may rise again, by `DRIFT` at most:

    θ[k] = min(h[k] − d[k],  θ[k−1] + DRIFT · (d[k] − d[k−1]))
    lateness[k] = h[k] − (d[k] + θ[k]) ≥ 0

k numbers the samples; all times are in s. The estimate of θ includes the smallest transport
delay; lateness is the delay beyond it. A delayed sample raises the estimate by the drift at most.
So the estimate follows a device clock that is up to 100 ppm slow, and any clock that is fast.
"""

from __future__ import annotations

DRIFT = 100e-6
"""s per s: largest difference in rate between two crystal clocks"""


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
