"""Waiting for an absolute deadline: sleep until shortly before it, then spin."""

from __future__ import annotations

import time

SPIN_S = 200e-6
"""s before the deadline at which sleeping stops: a sleep overshoots by about this much"""


def wait_until(due_s: float) -> float:
    """Wait until ``due_s`` on `time.monotonic`; return the time then, in seconds."""
    now = time.monotonic()
    while (left := due_s - now) > 0:
        if left > SPIN_S:
            time.sleep(left - SPIN_S)
        now = time.monotonic()
    return now
