"""The device's clock on the host's: how late a sample of a device-timed stream came.

A sample taken at device time d arrives at host time h = d + θ + w: θ is what the two clocks
differ by, w ≥ 0 the time on the way. The smallest h − d seen is the best θ there is, and since
clocks drift it may rise again, at most by `DRIFT`:

    θ[k] = min(h[k] − d[k],  θ[k−1] + DRIFT · (d[k] − d[k−1]))
    lateness[k] = h[k] − (d[k] + θ[k]) ≥ 0

so a delayed sample does not move the map, and a device whose clock runs up to 100 ppm slow (as a
crystal may) is followed; a fast one is followed at once. What every sample takes on the way is
not seen: lateness is what comes on top of the quickest.
"""

from __future__ import annotations

DRIFT = 100e-6
"""s per s: by how much two crystals may differ."""


class ClockMap:
    """Follows one device's clock; times in seconds."""

    def __init__(self, device_s: float, host_s: float) -> None:
        """Start with a sample taken at ``device_s`` that arrived at ``host_s`` (monotonic)."""
        self._device = device_s
        self._offset = host_s - device_s

    def host(self, device_s: float) -> float:
        """The host time at which a sample of that device time is due, as far as is known."""
        return device_s + self._offset

    def arrived(self, device_s: float, host_s: float) -> float:
        """Take in one more sample; returns its lateness in s."""
        drifted = self._offset + DRIFT * max(0.0, device_s - self._device)
        self._device = device_s
        self._offset = min(host_s - device_s, drifted)
        return host_s - device_s - self._offset
