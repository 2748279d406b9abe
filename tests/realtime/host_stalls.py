"""Detects host stalls: intervals in which a virtual machine does not get its processors.

On every processor a process of the highest priority (SCHED_FIFO, if permitted) sleeps for 0.25 ms
again and again. If it wakes more than 0.4 ms late, no other program there could run in time either.
Stalls of 0.65 ms and more are detected.
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

SOURCE = Path(__file__).with_name("host_stalls.c")
LATE_S = 1e-3
AFTER_S = 2e-3
"""s after a stall in which queued work is still late"""
WRAP = 2**32
"""The device's clock, in µs"""


@dataclass
class Stalls:
    """(start, end) in s of the monotonic clock, filled at the end of `host_stalls`."""

    seen: list[tuple[float, float]] = field(default_factory=list)

    @property
    def worst_s(self) -> float:
        return max((b - a for a, b in self.seen), default=0.0)

    @property
    def together_s(self) -> float:
        """s of stalls in all; an interval on several processors counts once."""
        total, until = 0.0, float("-inf")
        for a, b in sorted(self.seen):
            total += max(0.0, b + AFTER_S - max(a, until))
            until = max(until, b + AFTER_S)
        return total

    def covers(self, start_s: np.ndarray, end_s: np.ndarray) -> np.ndarray:
        """(n,) bool: whether an interval overlaps a stall, or the time just after one."""
        out = np.zeros(len(start_s), dtype=bool)
        for a, b in self.seen:
            out |= (start_s < b + AFTER_S) & (end_s > a)
        return out


@contextmanager
def host_stalls() -> Iterator[Stalls]:
    """Detect stalls while the block runs; none without a C compiler."""
    stalls = Stalls()
    with ExitStack() as each:
        processes = [
            each.enter_context(_on(cpu)) for cpu in sorted(os.sched_getaffinity(0)) if COMPILER
        ]
        try:
            yield stalls
        finally:
            for process in processes:
                process.kill()
                assert process.stdout is not None
                words = [line.split() for line in process.stdout.read().splitlines()]
                stalls.seen += [(float(w[0]), float(w[1])) for w in words if len(w) == 2]
            stalls.seen.sort()


@functools.cache
def _program() -> str:
    program = BUILD / "host_stalls"
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
    """Late and missed periods, each under the first cause that explains it."""

    periods: int
    """All periods, missed ones included"""
    late: int
    stalled: int
    """In a host stall"""
    device: int
    """The firmware's process wrote the sample late; otherwise it would have been in time"""
    own: int
    """Without such a cause: the line, the kernel, the loop"""
    own_times: int
    """Number of such events; several missed periods in a row are one"""
    own_worst_s: float


def lateness(
    recording: Recording, stalls: Stalls, written_late_s: dict[int, float] | None = None
) -> Lateness:
    """Causes of the late periods of a flight.

    ``written_late_s``: a sample's time on the device's clock (µs modulo 2³²) → s until the device
    wrote it, from ``heli3dof-rig --late``.
    """
    channels = recording.channels
    came, late = channels["host_time_s"], channels["lateness_s"]
    before = np.diff(channels["device_time_s"], prepend=channels["device_time_s"][0] - recording.dt)
    skipped = np.maximum(np.rint(before / recording.dt).astype(int) - 1, 0)
    # The host missed as many periods as it was late by; the device left out the others.
    missed = np.minimum(skipped, np.floor(late / recording.dt + 1e-6).astype(int))
    count = missed + (late > LATE_S)
    in_stall = stalls.covers(came - late, came)
    times = np.rint(channels["device_time_s"] * 1e6).astype(np.int64) % WRAP
    kept = np.array([(written_late_s or {}).get(int(t), 0.0) for t in times])
    of_device = ~in_stall & (count == 1) & (late - kept <= LATE_S)
    own = ~in_stall & ~of_device & (count > 0)
    return Lateness(
        int(len(late) + missed.sum()),
        int(count.sum()),
        int(count[in_stall].sum()),
        int(count[of_device].sum()),
        int(count[own].sum()),
        int(own.sum()),
        float(late[own].max(initial=0.0)),
    )


def written_late(path: Path) -> dict[int, float]:
    """The file of ``heli3dof-rig --late``: device time (µs) → s."""
    rows = [line.split() for line in path.read_text(encoding="ascii").splitlines()]
    return {int(time): int(late) * 1e-6 for time, late in rows}
