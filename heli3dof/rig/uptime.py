"""A device's uptime: it counts milliseconds modulo 2³² on a clock of its own."""

from __future__ import annotations

UPTIME_WRAP_S = 2**32 / 1000
"""s: the uptime is stated in ms modulo 2³², 49.7 days (docs/reference/protocol.md, REPORT)"""
CLOCK_TOLERANCE = 5e-3
"""s per s: a ceramic resonator, the worst clock of a microcontroller board, is within 0.5 %"""


def wrapped_difference_s(a_s: float, b_s: float) -> float:
    """a − b modulo `UPTIME_WRAP_S`, in [−W/2, W/2).

    >>> wrapped_difference_s(1.0, UPTIME_WRAP_S - 1.0)
    2.0
    """
    half_s = UPTIME_WRAP_S / 2
    return (a_s - b_s + half_s) % UPTIME_WRAP_S - half_s
