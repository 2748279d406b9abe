"""A virtual machine's cores are kept from falling asleep.

An idle core of a virtual machine is handed back to its host. When something is due there the host
has to give it a processor again, and on a busy host that takes several periods, whatever priority
waits inside for it. The processor's own idle states can be refused (`realtime`), this cannot, but
by having something to do. So in flight its cores have something, at idle priority (`spinner`,
processes of their own: the interpreter's lock is the loop's), which stands in nobody's way inside.
All but the first have: a host that rations a machine to as many processors as it has counts its own
work for it, too, and stops one that uses all of them until its next ration. The flight stays on the
others where they are several. Everybody may do that. On a machine of one's own it would only heat
it; and in a container whose processor time is rationed it would eat the flight's ration.
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
TOLD = (Path("/sys/hypervisor/type"), Path("/proc/device-tree/hypervisor"))
"""Other places where a kernel says that it runs under another (Xen, ARM)"""
SPINNER = Path(__file__).with_name("spinner.py")
CGROUPS = Path("/sys/fs/cgroup")
MINE = Path("/proc/self/cgroup")
START_S = 2.0
END_S = 1.0


def keep_awake(undo: ExitStack, cores: Sequence[int], *, stay: bool) -> tuple[Check, ...]:
    """Give these cores of a virtual machine something to do until ``undo`` closes, but the first.

    ``stay``: keep all threads on them. No check on other machines.
    """
    if not cores or not is_virtual():
        return ()
    if is_rationed():
        says = "fall asleep to their host: kept awake they would use up this container's quota"
        return (Check(WHAT, says, None, "start the container without --cpus"),)
    names = [str(core) for core in cores[1:] or cores]
    try:
        spinner = subprocess.Popen(
            [sys.executable, "-I", "-S", str(SPINNER), *names],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except OSError as error:
        return (Check(WHAT, f"fall asleep to their host: {error.strerror}", None),)
    undo.callback(_end, spinner)
    awake = _begun(spinner, len(names))
    if not awake:
        return (Check(WHAT, "fall asleep to their host: what keeps them awake has ended", None),)
    if stay and len(awake) > 1:  # one would have to be shared with whatever else runs
        move(undo, {int(core) for core in awake}, everybody=True)
    return (Check(WHAT, f"{', '.join(sorted(awake, key=int))}: kept awake in flight", True),)


def is_virtual() -> bool:
    """Whether Linux says that another system has the processors."""
    if not sys.platform.startswith("linux"):
        return False
    try:
        lines = CPUINFO.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    flags = next((line for line in lines if line.startswith("flags")), "")
    return "hypervisor" in flags.split() or any(path.exists() for path in TOLD)


def is_rationed() -> bool:
    """Whether a control group that this program is in, or one above it, has a quota of time."""
    try:
        lines = [line.split(":", 2) for line in MINE.read_text().splitlines()]
    except OSError:
        return False
    for _, controllers, inside in lines:
        if controllers and "cpu" not in controllers.split(","):
            continue
        root, name = (CGROUPS / "cpu", "cpu.cfs_quota_us") if controllers else (CGROUPS, "cpu.max")
        group = root / inside.lstrip("/")
        for folder in (group, *group.parents):
            if folder.is_relative_to(root) and _quota(folder / name):
                return True
    return False


def _quota(path: Path) -> bool:
    try:
        return path.read_text().split()[0] not in ("max", "-1")
    except (OSError, IndexError):
        return False


def _begun(spinner: subprocess.Popen[bytes], expected: int) -> list[str]:
    """The cores that it says it turns on; those that are slow to start are not waited for."""
    assert spinner.stdout is not None
    said, until = b"", time.monotonic() + START_S
    while said.count(b"\n") < expected:
        left = max(0.0, until - time.monotonic())
        ready, _, _ = select.select([spinner.stdout], [], [], left)
        more = os.read(spinner.stdout.fileno(), 4096) if ready else b""
        if not more:
            break
        said += more
    return said.decode("ascii").split()


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
