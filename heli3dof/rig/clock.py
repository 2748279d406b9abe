"""`wait_until`: sleep until shortly before an absolute deadline, then poll the clock."""

from __future__ import annotations

import time

SPIN_S = 200e-6
"""s before the deadline from which it polls: a sleep overshoots by about this much"""


def wait_until(due_s: float) -> float:
    """Wait until ``due_s`` on `time.monotonic`; return that clock's time at the end, in s."""
    now = time.monotonic()
    while (left := due_s - now) > 0:
        if left > SPIN_S:
            time.sleep(left - SPIN_S)
        now = time.monotonic()
    return now
