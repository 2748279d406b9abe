"""The offset between the device's clock and the host's: how late each sample came.

A sample taken at device time d arrives at host time h = d + θ + w. θ is the offset between the
clocks, w ≥ 0 the transport delay. The smallest h − d so far is the best estimate of θ. Clocks
drift, so the estimate may rise again, by `DRIFT` at most:

    θ[k] = min(h[k] − d[k],  θ[k−1] + DRIFT · (d[k] − d[k−1]))
    lateness[k] = h[k] − (d[k] + θ[k]) ≥ 0

A delayed sample therefore does not move the estimate. A device clock that runs up to 100 ppm slow
is followed; a fast one is followed at once. The smallest transport delay is part of θ: lateness is
the delay beyond it.
"""

from __future__ import annotations

DRIFT = 100e-6
"""s per s: the largest difference between two crystals"""


class ClockOffset:
    """Tracks one device's clock; times in seconds."""

    def __init__(self, device_s: float, host_s: float) -> None:
        """Start with a sample taken at ``device_s`` that arrived at ``host_s`` (monotonic)."""
        self._device = device_s
        self._offset = host_s - device_s

    def host(self, device_s: float) -> float:
        """The estimated host time at which a sample of that device time is due."""
        return device_s + self._offset

    def arrived(self, device_s: float, host_s: float) -> float:
        """Add one more sample; returns its lateness in s."""
        drifted = self._offset + DRIFT * max(0.0, device_s - self._device)
        self._device = device_s
        self._offset = min(host_s - device_s, drifted)
        return host_s - device_s - self._offset
