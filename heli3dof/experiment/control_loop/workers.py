"""Raises the priority of the kernel workers that deliver a serial line's bytes.

The kernel passes on what a tty driver or a pseudo-terminal receives (``flush_to_ldisc``) in a
*kernel worker* (``kworker/u…``), a thread. The worker waits for a processor core among ordinary
programs, even if the loop that waits for the bytes has real-time priority. If permitted (root,
CAP_SYS_NICE), the workers run under SCHED_FIFO during a flight. Their priority is above that of the
recorder and the live view, and below that of the loop. USB and sockets do not use kernel workers.
"""

from __future__ import annotations

import os
from contextlib import ExitStack, suppress
from pathlib import Path

from heli3dof.rig.interface import Check

WHAT = "kernel's workers"
PRIORITY = 20
"""SCHED_FIFO priority: between the flight's other threads (1) and the loop (40)"""
PROC = Path("/proc")
NAME = "kworker/u"
BY_HAND = f"for p in $(pgrep {NAME}); do sudo chrt -f -p {PRIORITY} $p; done"


def raise_workers(undo: ExitStack) -> tuple[Check, ...]:
    """Run the kernel workers that serve serial lines under SCHED_FIFO until ``undo`` closes.

    Returns one check that states the result; an empty tuple if the system has no such workers.
    """
    if not hasattr(os, "sched_setscheduler"):
        return ()
    workers = _workers()
    # A killed flight leaves the workers at `PRIORITY`; this flight lowers them at its end.
    raised = (os.SCHED_FIFO, PRIORITY)
    ordinary = [pid for pid in workers if _policy(pid) in ((os.SCHED_OTHER, 0), raised)]
    try:
        for pid in ordinary:
            with suppress(ProcessLookupError):  # a worker that has ended
                os.sched_setscheduler(pid, os.SCHED_FIFO, os.sched_param(PRIORITY))
                undo.callback(_lower, pid)
    except OSError:
        found = "ordinary threads: on a busy computer a serial line is late despite other settings"
        return (Check(WHAT, found, None, BY_HAND),)
    return (Check(WHAT, "in real time, below the loop", True),) if workers else ()


def _workers() -> list[int]:
    pids = []
    for folder in PROC.iterdir() if PROC.is_dir() else ():
        if folder.name.isdigit():
            with suppress(OSError):
                if (folder / "comm").read_bytes().startswith(NAME.encode()):
                    pids.append(int(folder.name))
    return pids


def _policy(pid: int) -> tuple[int, int] | None:
    with suppress(OSError):
        return os.sched_getscheduler(pid), os.sched_getparam(pid).sched_priority
    return None


def _lower(pid: int) -> None:
    with suppress(OSError):
        os.sched_setscheduler(pid, os.SCHED_OTHER, os.sched_param(0))
