"""Compares uptimes of a device, which counts them in ms modulo 2³² on its own clock."""

from __future__ import annotations

UPTIME_WRAP_S = 2**32 / 1000
"""s after which the uptime starts again at zero: 49.7 days (docs/reference/protocol.md, REPORT)"""
CLOCK_TOLERANCE = 5e-3
"""s per s: error of the worst clock of a microcontroller board, a ceramic resonator (0.5 %)"""


def wrapped_difference_s(a_s: float, b_s: float) -> float:
    """Return the difference a_s − b_s of two uptimes, in s modulo W, within [−W/2, W/2).

    >>> wrapped_difference_s(1.0, UPTIME_WRAP_S - 1.0)
    2.0

    W = `UPTIME_WRAP_S`: the uptime in s at which the device's counter starts again from 0.
    """
    half_s = UPTIME_WRAP_S / 2
    return (a_s - b_s + half_s) % UPTIME_WRAP_S - half_s
