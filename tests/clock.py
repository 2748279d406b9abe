"""A virtual clock for tests, which host stalls do not affect."""

from __future__ import annotations

import subprocess
import time
from types import SimpleNamespace

import pytest

READ_S = 1e-6


class Clock:
    """Its time advances by the duration of each sleep, and by `READ_S` at each reading."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def monotonic(self) -> float:
        self.now_s += READ_S
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += max(0.0, seconds)


def installed(patch: pytest.MonkeyPatch) -> Clock:
    """Replace `time.monotonic` and `time.sleep` of this process by a virtual clock's.

    Only for tests in which one thread is both rig and host: a wait for another thread or the
    system would never end. `subprocess` keeps the computer's clock. It polls a process by sleeping,
    so a process that a busy computer delays would let minutes pass on the virtual clock.
    """
    clock = Clock()
    patch.setattr(subprocess, "time", SimpleNamespace(sleep=time.sleep))
    patch.setattr(time, "monotonic", clock.monotonic)
    patch.setattr(time, "sleep", clock.sleep)
    return clock
