"""A clock of a test's own: a machine that stands still cannot hold it up."""

from __future__ import annotations

import time

import pytest

LOOK_S = 1e-6


class Clock:
    """Time that passes only when somebody sleeps, or a little when it is looked at."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        self.now_s += LOOK_S
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += max(0.0, seconds)


def installed(patch: pytest.MonkeyPatch) -> Clock:
    """What `time.monotonic` and `time.sleep` are from now on, for whatever runs in this process.

    Good where one thread is both rig and host. Who waits for another thread, a process or the
    system waits in vain.
    """
    clock = Clock()
    patch.setattr(time, "monotonic", clock.monotonic)
    patch.setattr(time, "sleep", clock.sleep)
    return clock
