"""The kernel's unbound workers, through which a serial line's bytes must pass.

What a tty driver or a pseudo-terminal receives is handed on by ``flush_to_ldisc`` in a *kernel
worker* (``kworker/u…``): a thread like any other, which waits for a core among ordinary programs,
and behind whatever is scheduled in real time, whatever priority the loop has that waits for the
bytes. Where it is permitted (root's, CAP_SYS_NICE) these workers run under SCHED_FIFO in flight:
above the recorder and the live view, below the loop. USB and sockets do without them.
"""

from __future__ import annotations

import os
from contextlib import ExitStack, suppress
from pathlib import Path

from heli3dof.rig.interface import Check

WHAT = "kernel's workers"
PRIORITY = 20
"""Above what stands beside the loop, below the loop"""
PROC = Path("/proc")
NAME = "kworker/u"
BY_HAND = f"for p in $(pgrep {NAME}); do sudo chrt -f -p {PRIORITY} $p; done"


def raise_workers(undo: ExitStack) -> tuple[Check, ...]:
    """Put them under SCHED_FIFO until ``undo`` closes; no check where there are none to be seen."""
    if not hasattr(os, "sched_setscheduler"):
        return ()
    found = _workers()
    # Those that a flight left so which was killed are put back after this one.
    left_so = (os.SCHED_FIFO, PRIORITY)
    ordinary = [pid for pid in found if _policy(pid) in ((os.SCHED_OTHER, 0), left_so)]
    try:
        for pid in ordinary:
            with suppress(ProcessLookupError):  # they come and go
                os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
                undo.callback(_lower, pid)
    except OSError:
        says = "ordinary threads: on a busy computer a serial line is late, whatever is granted"
        return (Check(WHAT, says, None, BY_HAND),)
    return (Check(WHAT, "in real time, below the loop", True),) if found else ()


def _workers() -> list[int]:
    found = []
    for folder in PROC.iterdir() if PROC.is_dir() else ():
        if folder.name.isdigit():
            with suppress(OSError):
                if (folder / "comm").read_bytes().startswith(NAME.encode()):
                    found.append(int(folder.name))
    return found


def _policy(pid: int) -> tuple[int, int] | None:
    with suppress(OSError):
        return os.sched_getscheduler(pid), os.sched_getparam(pid).sched_priority
    return None


def _lower(pid: int) -> None:
    with suppress(OSError):
        os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))
