"""How a link has been: counters and the round trip's distribution, for doctor and the benches."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

BIN_S = 10e-6
"""s, a bin of the histogram"""
BINS = 2000
"""So the last one holds everything from 20 ms on."""


@dataclass
class Histogram:
    """Times in bins of `BIN_S`; constant memory, one addition a value."""

    counts: list[int] = field(default_factory=lambda: [0] * BINS)
    worst_s: float = 0.0

    def add(self, time_s: float) -> None:
        self.counts[min(max(int(time_s / BIN_S), 0), BINS - 1)] += 1
        if time_s > self.worst_s:
            self.worst_s = time_s

    @property
    def n(self) -> int:
        return sum(self.counts)

    def quantile_s(self, share: float) -> float:
        """The upper edge of the bin that holds this share of the values; NaN where there is none.

        >>> h = Histogram(); h.add(12e-6); round(h.quantile_s(0.5) * 1e6)
        20
        """
        n, below = self.n, 0
        if n == 0:
            return math.nan
        for i, count in enumerate(self.counts):
            below += count
            if below >= share * n:
                return (i + 1) * BIN_S if i < BINS - 1 else self.worst_s
        return self.worst_s


@dataclass
class LinkStatistics:
    """Since the link was opened."""

    sent: int = 0
    """Frames to the device"""
    received: int = 0
    """Frames from it, whole and right"""
    damaged: int = 0
    """Pieces that were no frame"""
    lost: int = 0
    """Samples that the device made and that never came: numbers are missing"""
    left_out: int = 0
    """Samples that the device, held up itself, never made: time jumped, no number is missing"""
    passed_over: int = 0
    """Samples that came too late to be of use: with a newer one, or after the next command"""
    rejected: int = 0
    """Whole samples that cannot be: an echo of what was not sent, a number that was there before"""
    commands: int = 0
    unheard: int = 0
    """Commands that the sample after them did not echo: lost, refused, or too late on the line"""
    repeats: int = 0
    """Questions asked again because no answer came"""
    round_trip: Histogram = field(default_factory=Histogram)
    """From a question to its answer"""
    delay: Histogram = field(default_factory=Histogram)
    """From a sample to the command that follows it, measured by the device"""
