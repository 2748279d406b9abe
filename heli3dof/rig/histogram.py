"""A histogram of times with logarithmic bins: quantiles in constant memory.

    bin(t) = ⌈ln(t / SHORTEST_S) / ln(1 + RATIO)⌉     bin 0: up to SHORTEST_S; the last: from 85 s

t is a time in s. A quantile is reported as the upper edge of its bin, at most 1 % too long. A
quantile in bin 0 is reported as 0, a quantile in the last bin as the longest time added, which is
stored exactly.
"""

from __future__ import annotations

from array import array
from itertools import accumulate
from math import ceil, log, nan

SHORTEST_S = 1e-7
"""s: below the resolution of every clock used here"""
RATIO = 0.01
"""Share by which a bin's upper edge exceeds its lower one"""
BINS = 2068
_STEP = log(1 + RATIO)


class Histogram:
    """Histogram of durations in s, in logarithmic bins. `quantile_s` returns its quantiles."""

    def __init__(self) -> None:
        self.counts = array("Q", bytes(8 * BINS))
        self.worst_s = 0.0

    def add(self, time_s: float) -> None:
        """Add a time in s to the count of its bin; a negative time counts as zero."""
        at = 0
        if time_s > SHORTEST_S:
            at = min(ceil(log(time_s / SHORTEST_S) / _STEP), BINS - 1)
        if time_s > self.worst_s:
            self.worst_s = time_s
        self.counts[at] += 1

    @property
    def n(self) -> int:
        return sum(self.counts)

    def quantile_s(self, share: float) -> float:
        """Return the time (s) that a ``share`` (0 … 1) of the times does not exceed; NaN if empty.

        >>> h = Histogram(); h.add(12e-6); h.add(80e-6); round(h.quantile_s(0.5) * 1e6, 1)
        12.1
        """
        n = self.n
        if n == 0:
            return nan
        wanted = max(1, share * n)
        i = next(i for i, below in enumerate(accumulate(self.counts)) if below >= wanted)
        if i in (0, BINS - 1):
            return self.worst_s if i else 0.0
        return min(SHORTEST_S * (1 + RATIO) ** i, self.worst_s)
