"""Waits for an absolute deadline: sleeps until shortly before it, then polls the clock."""

from __future__ import annotations

import time

SPIN_S = 200e-6
"""s before the deadline at which polling starts: a sleep overshoots by about this much"""


def wait_until(due_s: float) -> float:
    """Wait until the time ``due_s`` (s, `time.monotonic`); return the time after the wait, in s."""
    now = time.monotonic()
    while (left := due_s - now) > 0:
        if left > SPIN_S:
            time.sleep(left - SPIN_S)
        now = time.monotonic()
    return now
