"""Chooses the processor core that a flight's threads share.

The threads take turns for the interpreter anyway. On one core they delay, under SCHED_FIFO
(real-time scheduling), neither another flight nor the kernel's workers that deliver a serial line's
bytes. The choice, in this order:

1. a core that the kernel keeps free of other programs (``isolcpus=``)
2. under SCHED_FIFO: the last core that no other flight has, but not the first
3. none: the kernel moves ordinary threads, which on a fixed core would wait for other programs
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
"""Name of an abstract socket: only one flight can bind it, and it disappears with the process"""


def on_one_core(undo: ExitStack, *, scheduled: bool) -> tuple[Check, ...]:
    """Move the calling thread to the flight's core; return a check of ``heli3dof doctor``.

    ``scheduled``: the loop runs under SCHED_FIFO; then all threads of this program move. ``undo``
    moves them back when it closes. Returns no check if no thread was moved.
    """
    if not hasattr(os, "sched_setaffinity"):
        return ()
    kept_free = isolated_cores()
    if kept_free:
        move(undo, kept_free, all_threads=scheduled)
        return (Check("core", f"{_text(ISOLATED)}, which the kernel keeps free", True),)
    core = _claimed(undo) if scheduled else None
    if core is None:
        return ()
    move(undo, {core}, all_threads=True)
    return (Check("core", f"{core}, for all threads of this program", True),)


def available_cores() -> list[int]:
    """Return the cores in this process's affinity mask and the isolated ones (``isolcpus=``).

    An empty list if the operating system does not support CPU affinity.
    """
    if not hasattr(os, "sched_getaffinity"):
        return []
    return sorted(os.sched_getaffinity(0) | isolated_cores())


def isolated_cores() -> set[int]:
    """Return the cores that the kernel keeps free of other programs (``isolcpus=``)."""
    text = _text(ISOLATED)
    return parse_cores(text) if text else set()


def parse_cores(text: str) -> set[int]:
    """Return the core numbers in a text in the kernel's notation.

    >>> sorted(parse_cores("2-3,7"))
    [2, 3, 7]
    """
    cores: set[int] = set()
    for part in text.split(","):
        first, _, last = part.partition("-")
        cores.update(range(int(first), int(last or first) + 1))
    return cores


def _claimed(undo: ExitStack) -> int | None:
    """Claim and return the last core that no other flight has; None if only the first is left."""
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


def move(undo: ExitStack, to: set[int], *, all_threads: bool) -> None:
    """Restrict the calling thread, or all threads, to the cores ``to`` until ``undo`` closes."""
    threads = {0}
    if all_threads:
        own = threading.get_native_id()
        threads |= {t.native_id for t in threading.enumerate() if t.native_id not in (None, own)}
    for thread in threads:
        with suppress(OSError):  # a thread that has ended
            before = os.sched_getaffinity(thread)
            os.sched_setaffinity(thread, to)
            undo.callback(_move_back, thread, before)


def _move_back(thread: int, before: set[int]) -> None:
    with suppress(OSError):  # a thread that has ended
        os.sched_setaffinity(thread, before)


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return None
