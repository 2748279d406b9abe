"""When the machine itself stood still: a virtual one is not always given its processors.

On every processor a process above all others (SCHED_FIFO, where permitted) sleeps for `EVERY_S`
again and again; where it wakes more than `STILL_S` late, nothing else there could have run in time
either.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field

import numpy as np

from heli3dof.recording.recording import Recording

EVERY_S = 1e-3
STILL_S = 0.7e-3
LATE_S = 1e-3
AFTER_S = 5e-3
"""What was queued meanwhile is late for a little longer."""
PROGRAM = f"""
import os, sys, time
os.sched_setaffinity(0, {{int(sys.argv[1])}})
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(95))
except OSError:
    pass
print("watching", flush=True)
while True:
    start = time.monotonic()
    time.sleep({EVERY_S})
    if time.monotonic() - start > {EVERY_S + STILL_S}:
        print(start, time.monotonic(), flush=True)
"""


@dataclass
class Standstills:
    """(start, end) in s of the monotonic clock, known once the watch is over."""

    seen: list[tuple[float, float]] = field(default_factory=list)

    @property
    def worst_s(self) -> float:
        return max((b - a for a, b in self.seen), default=0.0)

    def covers(self, start_s: np.ndarray, end_s: np.ndarray) -> np.ndarray:
        """(n,) bool: whether an interval has a part in a standstill, or just after one."""
        out = np.zeros(len(start_s), dtype=bool)
        for a, b in self.seen:
            out |= (start_s < b + AFTER_S) & (end_s > a)
        return out


@contextmanager
def watched() -> Iterator[Standstills]:
    """Watches while the block runs."""
    found = Standstills()
    with ExitStack() as each:
        said = [each.enter_context(_on(cpu)) for cpu in sorted(os.sched_getaffinity(0))]
        try:
            yield found
        finally:
            for process in said:
                process.kill()
                assert process.stdout is not None
                words = [line.split() for line in process.stdout.read().splitlines()]
                found.seen += [(float(w[0]), float(w[1])) for w in words if len(w) == 2]
            found.seen.sort()


@contextmanager
def _on(cpu: int) -> Iterator[subprocess.Popen[str]]:
    words = [sys.executable, "-c", PROGRAM, str(cpu)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process


def late_of_its_own(recording: Recording, still: Standstills) -> tuple[int, int]:
    """(late periods, those of them outside standstills); missed periods count as late."""
    channels = recording.channels
    came, late = channels["host_time_s"], channels["lateness_s"]
    device = channels["device_time_s"]
    before = np.diff(device, prepend=device[0] - recording.dt)
    missed = np.maximum(np.rint(before / recording.dt).astype(int) - 1, 0)
    count = missed + (late > LATE_S)
    own = ~still.covers(came - late - missed * recording.dt, came)
    return int(count.sum()), int(count[own].sum())
