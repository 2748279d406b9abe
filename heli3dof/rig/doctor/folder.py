"""Checks the folder of recordings: permission, free space, time to write to the disk."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from heli3dof.errors import quoted
from heli3dof.rig.doctor import RECORDINGS, checks_of, verdict
from heli3dof.rig.interface import Check

LEAST_FREE_BYTES = 1 << 30
"""bytes that must be free: a flight of 10 min takes about 15 MB, its analysis as much again"""
PIECE_BYTES = 32 * 1024
"""bytes, about as many as the recorder writes at a time"""
TRIES = 20
SLOW_S = 0.3
"""s: a longer median is reported; a power failure loses data that is not yet on the disk"""


def free_space(folder: Path) -> Check:
    """Return a `Check` that the disk of ``folder`` has at least `LEAST_FREE_BYTES` free."""
    what = "room for recordings"
    free = shutil.disk_usage(folder).free
    found = f"{free / 1e9:.1f} GB free in {folder}"
    fix = f"make room, or record elsewhere with -o; df -h {quoted(folder)}"
    return verdict(what, found, free >= LEAST_FREE_BYTES, fix)


def write_time(folder: Path) -> Check:
    """Return a `Check` that a write in ``folder``, with fsync, takes at most `SLOW_S` s.

    The time is the median of `TRIES` writes. The check fails if ``folder`` is not writable.
    """
    what = "time to the disk"
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            took = sorted(_once(file.fileno()) for _ in range(TRIES))
    except OSError as problem:
        reason = (problem.strerror or str(problem)).lower()
        found = f"{folder} cannot be written: {reason}"
        return Check(what, found, False, f"ls -ld {quoted(folder)}")
    found = f"{took[TRIES // 2] * 1e3:.1f} ms at the median, {took[-1] * 1e3:.0f} ms at worst"
    fix = "record to a local disk with -o: this one is a network drive, a card, or very busy"
    return verdict(what, found, took[TRIES // 2] <= SLOW_S, fix)


GROUP = RECORDINGS
CHECKS: tuple[Callable[[Path], Check], ...] = (free_space, write_time)


def checks(folder: Path) -> Iterator[Check]:
    """Run every check on ``folder``, or on its nearest existing parent; yield the results."""
    folder = folder.absolute()
    while not folder.is_dir():
        folder = folder.parent
    for check in checks_of(GROUP):
        yield check(folder)


def _once(file: int) -> float:
    start = time.monotonic()
    os.write(file, b"\0" * PIECE_BYTES)
    os.fsync(file)
    return time.monotonic() - start
