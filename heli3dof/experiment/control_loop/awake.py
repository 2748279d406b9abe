"""Keeps the cores of a virtual machine from going idle during a flight.

The host takes an idle core of a virtual machine back. On a busy host, several periods pass until
the machine gets the core again, whatever the priority inside the machine. A process per core at
idle priority (`spinner`) prevents that, and gives way to all other work inside. It is a process of
its own because the flight's threads share one interpreter lock.

* The first of several cores stays idle: a host that rations processor time also counts the work
  that it does for the machine, and would stop a machine that uses all its cores.
* A physical machine needs none of this.
* A container with a quota of processor time gets none: it would use up the flight's quota.
"""

from __future__ import annotations

import os
import select
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from heli3dof.experiment.control_loop.cores import move
from heli3dof.rig.interface import Check

WHAT = "virtual cores"
CPUINFO = Path("/proc/cpuinfo")
HYPERVISOR = (Path("/sys/hypervisor/type"), Path("/proc/device-tree/hypervisor"))
"""Files that exist under a hypervisor which the processor's flags do not show (Xen, ARM)"""
SPINNER = Path(__file__).with_name("spinner.py")
CGROUPS = Path("/sys/fs/cgroup")
OWN_CGROUP = Path("/proc/self/cgroup")
START_S = 2.0
"""s in which the spinner must report its cores; it takes some ms"""
END_S = 1.0
"""s in which the spinner must end before it is killed"""


def keep_awake(undo: ExitStack, cores: Sequence[int], *, stay: bool) -> tuple[Check, ...]:
    """Keep a virtual machine's cores, all but the first of several, busy until ``undo`` closes.

    Returns the result as checks of ``heli3dof doctor``; none on a physical machine. ``stay``: also
    restrict this program's threads to the busy cores, if there are two or more. ``cores``: the core
    numbers.
    """
    if not cores or not is_virtual():
        return ()
    if is_rationed():
        found = "may go idle: keeping them busy would use up this container's quota"
        return (Check(WHAT, found, None, "start the container without --cpus"),)
    names = [str(core) for core in cores[1:] or cores]
    try:
        spinner = subprocess.Popen(
            [sys.executable, "-I", "-S", str(SPINNER), *names],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError as error:
        return (Check(WHAT, f"may go idle: {error.strerror}", None),)
    undo.callback(_end, spinner)
    awake = _reported_cores(spinner, len(names))
    if not awake:
        return (Check(WHAT, "may go idle: the program that keeps them busy ended", None),)
    if stay and len(awake) > 1:  # a single core would be shared with all other programs
        move(undo, {int(core) for core in awake}, all_threads=True)
    return (Check(WHAT, f"{', '.join(sorted(awake, key=int))}: kept busy in flight", True),)


def is_virtual() -> bool:
    """Return True if this is Linux and reports that it runs in a virtual machine."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    flags = next((line for line in lines if line.startswith("flags")), "")
    return "hypervisor" in flags.split() or any(path.exists() for path in HYPERVISOR)


def is_rationed() -> bool:
    """Return True if this program's cgroup, or one above it, has a quota of processor time."""
    try:
        lines = [line.split(":", 2) for line in OWN_CGROUP.read_text().splitlines()]
    except OSError:
        return False
    for _, controllers, inside in lines:
        if controllers and "cpu" not in controllers.split(","):
            continue
        root, name = (CGROUPS / "cpu", "cpu.cfs_quota_us") if controllers else (CGROUPS, "cpu.max")
        group = root / inside.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(root) and _has_quota(folder / name):
                return True
    return False


def _has_quota(path: Path) -> bool:
    try:
        return path.read_text().split()[0] not in ("max", "-1")
    except (OSError, IndexError):
        return False


def _reported_cores(spinner: subprocess.Popen[bytes], expected: int) -> list[str]:
    """Return the core numbers that the spinner reports within `START_S`, ``expected`` at most."""
    assert spinner.stdout is not None
    reported, until = b"", time.monotonic() + START_S
    while reported.count(b"\n") < expected:
        left = max(0.0, until - time.monotonic())
        ready, _, _ = select.select([spinner.stdout], [], [], left)
        more = os.read(spinner.stdout.fileno(), 4096) if ready else b""
        if not more:
            break
        reported += more
    return reported.decode("ascii").split()


def _end(spinner: subprocess.Popen[bytes]) -> None:
    assert spinner.stdin is not None
    assert spinner.stdout is not None
    spinner.stdin.close()
    try:
        spinner.wait(END_S)
    except subprocess.TimeoutExpired:
        spinner.kill()
        spinner.wait()
    spinner.stdout.close()
