"""When the machine itself stood still: a virtual one is not always given its processors.

On every processor a process above all others (SCHED_FIFO, where permitted) sleeps for 0.25 ms again
and again; where it wakes more than 0.4 ms late, nothing else there could have run in time either.
So whatever stands still for 0.65 ms and more is seen.
"""

from __future__ import annotations

import fcntl
import functools
import os
import subprocess
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from heli3dof.recording.recording import Recording
from tests.drivers.firmware.building import BUILD, COMPILER

SOURCE = Path(__file__).with_name("standstill.c")
LATE_S = 1e-3
AFTER_S = 2e-3
"""What was queued meanwhile is late for a little longer."""
WRAP = 2**32
"""The device's clock, in µs"""


@dataclass
class Standstills:
    """(start, end) in s of the monotonic clock, known once the watch is over."""

    seen: list[tuple[float, float]] = field(default_factory=list)

    @property
    def worst_s(self) -> float:
        return max((b - a for a, b in self.seen), default=0.0)

    @property
    def together_s(self) -> float:
        """s that are put down to them, what several processors share once."""
        total, until = 0.0, float("-inf")
        for a, b in sorted(self.seen):
            total += max(0.0, b + AFTER_S - max(a, until))
            until = max(until, b + AFTER_S)
        return total

    def covers(self, start_s: np.ndarray, end_s: np.ndarray) -> np.ndarray:
        """(n,) bool: whether an interval has a part in a standstill, or just after one."""
        out = np.zeros(len(start_s), dtype=bool)
        for a, b in self.seen:
            out |= (start_s < b + AFTER_S) & (end_s > a)
        return out


@contextmanager
def watched() -> Iterator[Standstills]:
    """Watches while the block runs; sees nothing where there is no C compiler."""
    found = Standstills()
    with ExitStack() as each:
        said = [each.enter_context(_on(cpu)) for cpu in sorted(os.sched_getaffinity(0)) if COMPILER]
        try:
            yield found
        finally:
            for process in said:
                process.kill()
                assert process.stdout is not None
                words = [line.split() for line in process.stdout.read().splitlines()]
                found.seen += [(float(w[0]), float(w[1])) for w in words if len(w) == 2]
            found.seen.sort()


@functools.cache
def _program() -> str:
    program = BUILD / "standstill"
    BUILD.mkdir(parents=True, exist_ok=True)
    with (BUILD / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        made = ["cc", "-O2", "-Wall", "-D_GNU_SOURCE", "-o", str(program), str(SOURCE)]
        if not program.exists() or program.stat().st_mtime < SOURCE.stat().st_mtime:
            subprocess.run(made, check=True)
    return str(program)


@contextmanager
def _on(cpu: int) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen([_program(), str(cpu)], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield process


@dataclass(frozen=True)
class Lateness:
    """Periods that came late or were missed, each under the first cause that explains it."""

    periods: int
    """All there were, those that were missed too"""
    late: int
    stood_still: int
    """Their way fell into a standstill of the machine."""
    device: int
    """The firmware's own process wrote the sample late, by so much that it was in time else."""
    own: int
    """What is left: the line's, the kernel's, ours"""
    own_times: int
    """How often that was: several missed periods in a row are one time"""
    own_worst_s: float


def lateness(
    recording: Recording, still: Standstills, written_late_s: dict[int, float] | None = None
) -> Lateness:
    """What late periods of a flight are to be put down to.

    ``written_late_s``: by a sample's time on the device's clock (µs modulo 2³²), how long after
    it the device wrote it, as ``heli3dof-rig --late`` tells.
    """
    channels = recording.channels
    came, late = channels["host_time_s"], channels["lateness_s"]
    before = np.diff(channels["device_time_s"], prepend=channels["device_time_s"][0] - recording.dt)
    skipped = np.maximum(np.rint(before / recording.dt).astype(int) - 1, 0)
    # The host missed as many of these as it was late for; what the device left out is not late.
    missed = np.minimum(skipped, np.floor(late / recording.dt + 1e-6).astype(int))
    count = missed + (late > LATE_S)
    in_standstill = still.covers(came - late, came)
    times = np.rint(channels["device_time_s"] * 1e6).astype(np.int64) % WRAP
    kept = np.array([(written_late_s or {}).get(int(t), 0.0) for t in times])
    of_device = ~in_standstill & (count == 1) & (late - kept <= LATE_S)
    own = ~in_standstill & ~of_device & (count > 0)
    return Lateness(
        int(len(late) + missed.sum()),
        int(count.sum()),
        int(count[in_standstill].sum()),
        int(count[of_device].sum()),
        int(count[own].sum()),
        int(own.sum()),
        float(late[own].max(initial=0.0)),
    )


def written_late(path: Path) -> dict[int, float]:
    """What ``heli3dof-rig --late`` wrote."""
    rows = [line.split() for line in path.read_text(encoding="ascii").splitlines()]
    return {int(time): int(late) * 1e-6 for time, late in rows}
