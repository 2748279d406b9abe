"""Which core a flight runs on.

All threads of a flight share one: they take turns for the interpreter anyway, the loop comes first
there, and nothing that they do under SCHED_FIFO keeps anybody waiting elsewhere, neither another
flight nor the kernel's workers that bring a serial line's bytes. It is one that the kernel was
told to keep free (``isolcpus=``), else the last one that no other flight has. Without SCHED_FIFO a
thread would wait there behind ordinary programs, and is left to the kernel.
"""

from __future__ import annotations

import os
import socket
import threading
from contextlib import ExitStack, suppress
from pathlib import Path

from heli3dof.rig.interface import Check

ISOLATED = Path("/sys/devices/system/cpu/isolated")
CLAIM = "\0heli3dof-core-{}"
"""An abstract socket's name: one flight has it, and it goes with the process"""


def on_one_core(undo: ExitStack, *, scheduled: bool) -> tuple[Check, ...]:
    """Move the calling thread, and if ``scheduled`` all others, to a core of their own.

    What was done is undone when ``undo`` closes; where nothing can be, there is no check.
    """
    if not hasattr(os, "sched_setaffinity"):
        return ()
    kept_free = isolated_cores()
    if kept_free:
        move(undo, kept_free, everybody=scheduled)
        found = f"{_text(ISOLATED)}, which the kernel keeps free"
        return (Check("core", found, True),)
    core = _claimed(undo) if scheduled else None
    if core is None:
        return ()
    move(undo, {core}, everybody=True)
    return (Check("core", f"{core}, for all threads of this program", True),)


def my_cores() -> list[int]:
    """This program's, and those that the kernel was told to keep free; none where nobody says."""
    if not hasattr(os, "sched_getaffinity"):
        return []
    return sorted(os.sched_getaffinity(0) | isolated_cores())


def isolated_cores() -> set[int]:
    """Those that the kernel was told to keep free."""
    text = _text(ISOLATED)
    return cores(text) if text else set()


def cores(text: str) -> set[int]:
    """The kernel's way to write a set of cores.

    >>> sorted(cores("2-3,7"))
    [2, 3, 7]
    """
    found: set[int] = set()
    for part in text.split(","):
        first, _, last = part.partition("-")
        found.update(range(int(first), int(last or first) + 1))
    return found


def _claimed(undo: ExitStack) -> int | None:
    """The last core that no other flight has; None where only the first is left."""
    for core in sorted(os.sched_getaffinity(0))[:0:-1]:
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            claim.bind(CLAIM.format(core))
        except OSError:
            claim.close()
            continue
        undo.callback(claim.close)
        return core
    return None


def move(undo: ExitStack, to: set[int], *, everybody: bool) -> None:
    """Let the calling thread, or all threads, run on these cores only until ``undo`` closes."""
    threads = {0}
    if everybody:
        mine = threading.get_native_id()
        threads |= {t.native_id for t in threading.enumerate() if t.native_id not in (None, mine)}
    for thread in threads:
        with suppress(OSError):  # it may have ended by now
            before = os.sched_getaffinity(thread)
            os.sched_setaffinity(thread, to)
            undo.callback(_put_back, thread, before)


def _put_back(thread: int, before: set[int]) -> None:
    with suppress(OSError):  # a thread that has ended
        os.sched_setaffinity(thread, before)


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return None
