"""Real-time settings for the control loop, in force during a flight.

=============  ==========================================  ======================================
setting        purpose                                     permission
=============  ==========================================  ======================================
scheduling     SCHED_FIFO: no ordinary program delays      rtprio in limits.d, or CAP_SYS_NICE
               the loop
memory         mlockall: no page of the program has to be  memlock in limits.d, or CAP_IPC_LOCK
               read from the disk in flight
idle states    a core wakes up without delay               write access to /dev/cpu_dma_latency
workers        kernel threads that serve serial lines      CAP_SYS_NICE
               have priority over programs (`workers`)
timer          sleeps end within 1 µs, not 50              none needed
interpreter    no garbage collection; other threads give   none needed
               way within 0.1 ms
=============  ==========================================  ======================================

The flight goes on without a setting that is not granted; `Realtime` reports the command that grants
it. While another thread of this program holds the interpreter's lock, the loop must wait. So the
other threads run under SCHED_FIFO, too, with a lower priority than the loop. Then no ordinary
program delays them.
"""

from __future__ import annotations

import ctypes
import gc
import os
import platform
import struct
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from heli3dof.experiment.control_loop.workers import raise_workers
from heli3dof.rig.interface import Check

PRIORITY = 40
"""SCHED_FIFO priority of the loop (range 1 to 99); the kernel's interrupt threads have 50"""
OTHERS_PRIORITY = 1
"""SCHED_FIFO priority of the recorder and the live view"""
SWITCH_S = 1e-4
"""s after which a thread that holds the interpreter's lock gives way"""
LIMITS_D = "/etc/security/limits.d/heli3dof.conf"
_CAP_IPC_LOCK = 14
_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_PR_SET_TIMERSLACK, _PR_GET_TIMERSLACK = 29, 30


@dataclass(frozen=True)
class Realtime:
    """Result of requesting real-time settings: a `Check` of each, granted or refused."""

    checks: tuple[Check, ...]
    scheduled: bool
    """True if the loop ran under SCHED_FIFO"""
    locked: bool
    """True if the program's memory was locked"""

    @property
    def refused(self) -> tuple[Check, ...]:
        return tuple(check for check in self.checks if check.good is False)

    def to_dict(self) -> dict[str, Any]:
        """Return the granted and refused settings as a dict for the recording's outcome."""
        return {
            "scheduled": self.scheduled,
            "memory_locked": self.locked,
            "found": {check.what: check.found for check in self.checks},
            "refused": [{"what": c.what, "why": c.found, "fix": c.fix} for c in self.refused],
        }


@contextmanager
def realtime(priority: int = PRIORITY) -> Iterator[Realtime]:
    """Context manager: apply all permitted real-time settings; undo them after the block.

    The calling thread gets the SCHED_FIFO ``priority`` (1 to 99).
    """
    with ExitStack() as undo:
        gc.collect()
        quiet_interpreter(undo)
        scheduling, memory = _scheduling(undo, priority), _memory(undo)
        scheduled = scheduling.good is True
        checks = [scheduling, memory, *_idle_states(undo)]
        if scheduled:
            checks += raise_workers(undo)
        _timer(undo)
        yield Realtime(tuple(checks), scheduled, memory.good is True)


def quiet_interpreter(undo: ExitStack) -> None:
    """Turn garbage collection off and set the threads' switch interval to `SWITCH_S` (s).

    Both settings are restored when ``undo`` closes.
    """
    undo.callback(sys.setswitchinterval, sys.getswitchinterval())
    if gc.isenabled():
        undo.callback(gc.enable)
    gc.disable()
    sys.setswitchinterval(SWITCH_S)


def _scheduling(undo: ExitStack, priority: int) -> Check:
    what = "real-time scheduling"
    if not hasattr(os, "sched_setscheduler"):
        return Check(what, f"{platform.system()} does not offer it", None)
    try:
        priority = _schedule(undo, 0, priority)
    except OSError as error:
        return Check(what, f"not granted: {_reason(error)}", False, _permit())
    for thread in threading.enumerate():
        if thread.native_id not in (None, threading.get_native_id()):
            with suppress(OSError):  # a thread that has ended
                _schedule(undo, thread.native_id or 0, min(OTHERS_PRIORITY, priority))
    return Check(what, f"SCHED_FIFO at priority {priority}", True)


def _schedule(undo: ExitStack, thread: int, priority: int) -> int:
    """Run the thread with id ``thread`` (0: this thread) under SCHED_FIFO.

    Requests ``priority`` (1 to 99), and returns the priority that the system granted. When
    ``undo`` closes, it restores the former scheduling.
    """
    import resource

    before = os.sched_getscheduler(thread), os.sched_getparam(thread)
    fifo = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
    try:
        os.sched_setscheduler(thread, fifo, os.sched_param(priority))
    except PermissionError:
        _, most = resource.getrlimit(resource.RLIMIT_RTPRIO)
        if not 0 < most < priority:
            raise
        resource.setrlimit(resource.RLIMIT_RTPRIO, (most, most))
        priority = most
        os.sched_setscheduler(thread, fifo, os.sched_param(priority))

    def restore() -> None:
        policy, parameters = before
        with suppress(OSError):  # a thread that has ended
            try:
                os.sched_setscheduler(thread, policy, parameters)
            except PermissionError:  # only CAP_SYS_NICE may clear the flag
                os.sched_setscheduler(thread, policy | os.SCHED_RESET_ON_FORK, parameters)

    undo.callback(restore)
    return priority


def _memory(undo: ExitStack) -> Check:
    what = "locked memory"
    libc = _libc()
    if libc is None or not hasattr(libc, "mlockall") or not hasattr(os, "sched_setscheduler"):
        return Check(what, f"{platform.system()} does not offer it", None)
    if not _may_lock_everything():
        # Under a finite limit a later allocation would fail, in flight.
        return Check(what, "not granted: this user's limit (memlock) is finite", False, _permit())
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT):
        reason = _reason(OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno())))
        return Check(what, f"not granted: {reason}", False, _permit())
    undo.callback(libc.munlockall)
    return Check(what, "all that the program touches stays in memory", True)


def _may_lock_everything() -> bool:
    import resource

    soft, hard = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    if hard == resource.RLIM_INFINITY:
        if soft != hard:
            resource.setrlimit(resource.RLIMIT_MEMLOCK, (hard, hard))
        return True
    with suppress(OSError, ValueError, StopIteration):
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        held = next(line for line in lines if line.startswith("CapEff:"))
        return bool(int(held.split()[1], 16) >> _CAP_IPC_LOCK & 1)
    return False


def _idle_states(undo: ExitStack) -> tuple[Check, ...]:
    device = Path("/dev/cpu_dma_latency")
    if not device.exists():
        return ()
    try:
        held = undo.enter_context(device.open("wb", buffering=0))
        held.write(struct.pack("i", 0))
    except OSError as error:
        return (Check("deep idle states", f"allowed in flight: {_reason(error)}", None),)
    return (Check("deep idle states", "off in flight", True),)


def _timer(undo: ExitStack) -> None:
    libc = _libc()
    if sys.platform == "linux" and libc is not None:
        before = libc.prctl(_PR_GET_TIMERSLACK)
        if before > 0 and libc.prctl(_PR_SET_TIMERSLACK, 1000) == 0:
            undo.callback(libc.prctl, _PR_SET_TIMERSLACK, before)


def _libc() -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(None, use_errno=True)
    except (OSError, TypeError):
        return None


def _reason(error: OSError) -> str:
    if isinstance(error, PermissionError):
        return "not permitted to this user"
    return (error.strerror or str(error)).lower()


def _permit() -> str:
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        return "start the container with --cap-add=SYS_NICE --cap-add=IPC_LOCK"
    return (
        'printf \'%s - rtprio 80\\n%s - memlock unlimited\\n\' "$USER" "$USER" | '
        f"sudo tee {LIMITS_D}; then log in again"
    )
