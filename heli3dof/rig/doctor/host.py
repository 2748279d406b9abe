"""Checks the computer: clock, wake-up latency, frequency governors, load, memory.

Each check is called with the rig's profile, but only `wake_up` uses the profile.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from heli3dof.rig.clock import LATE_S, wait_until
from heli3dof.rig.doctor import COMPUTER, checks_of, verdict
from heli3dof.rig.interface import Check
from heli3dof.rig.profile import Profile

SYSTEM = Path("/sys/devices/system")
QUICK_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "timebase", "riscv_clocksource")
"""Clock sources that are read without a system call"""
WAKE_SECONDS = 1.0
RESOLUTION_S = 1e-6
"""s: a coarser clock is reported"""


def clock(profile: Profile) -> Check:
    """Return a `Check` that the monotonic clock resolves `RESOLUTION_S` s and is fast to read.

    For a slow clock the result is undecided (``good`` None) if the system offers no faster one.
    """
    what = "clock"
    resolution = time.get_clock_info("monotonic").resolution
    source = _text(SYSTEM / "clocksource/clocksource0/current_clocksource")
    found = f"{source or 'of the system'}, resolution {resolution * 1e9:.0f} ns"
    if resolution > RESOLUTION_S:
        # Python reads the fine clock of Windows since 3.13.
        fix = "Python 3.13 or newer" if os.name == "nt" else "a kernel with high-resolution timers"
        return Check(what, found, False, fix)
    if source is None or source in QUICK_CLOCKS:
        return Check(what, found, True)
    offered = (_text(SYSTEM / "clocksource/clocksource0/available_clocksource") or "").split()
    better = next((c for c in QUICK_CLOCKS if c in offered), None)
    if better is None:
        return Check(what, found + ": slow to read, and there is no other", None)
    file = SYSTEM / "clocksource/clocksource0/current_clocksource"
    return Check(what, found + ": slow to read", False, f"echo {better} | sudo tee {file}")


def wake_up(profile: Profile) -> Check:
    """Return a `Check` that this process wakes up on time, once in each control period.

    It passes if at most 0.1 % of the wake-ups in `WAKE_SECONDS` s are more than `LATE_S` s late.
    """
    dt = profile.dt
    n = max(10, round(WAKE_SECONDS / dt))
    start = time.monotonic() + dt
    late = sorted(wait_until(start + k * dt) - (start + k * dt) for k in range(n))
    worst, usual = late[-1], late[n // 2]
    over = sum(each > LATE_S for each in late)
    found = (
        f"at {1 / dt:g} Hz late by {usual * 1e6:.0f} µs at the median, {worst * 1e3:.2f} ms at "
        f"worst; {over} of {n} by more than 1 ms"
    )
    fix = "end other programs (top shows them), then permit real-time scheduling (above)"
    return verdict("wake-up", found, over <= 0.001 * n, fix)


def frequency(profile: Profile) -> Check:
    """Return a `Check` that the governor of the CPU frequency, if any, is ``performance``."""
    what = "frequency governor"
    files = sorted((SYSTEM / "cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    found = sorted({text for file in files if (text := _text(file)) is not None})
    if not found:
        return Check(what, "none: a virtual machine, or a fixed frequency", True)
    if found == ["performance"]:
        return Check(what, "performance", True)
    fix = f"echo performance | sudo tee {SYSTEM}/cpu/cpu*/cpufreq/scaling_governor"
    return Check(what, f"{', '.join(found)}: a core at rest is slow to start", False, fix)


def load(profile: Profile) -> Check:
    """Return a `Check` that the load average leaves at least half a processor core free.

    If not, the result is undecided: `wake_up` measures whether the control loop is late.
    ``profile`` is not used.
    """
    what = "other work"
    if not hasattr(os, "getloadavg"):
        return Check(what, "this system does not report it", None)
    busy, cores = os.getloadavg()[0], os.cpu_count() or 1
    found = f"{busy:.1f} programs ready to run, on {cores} cores"
    fix = "top shows them; end what the flight does not need"
    return Check(what, found, True) if busy <= cores - 0.5 else Check(what, found, None, fix)


def memory(profile: Profile) -> Check:
    """Return a `Check` that 512 MiB of memory are available."""
    what = "memory"
    text = _text(Path("/proc/meminfo"))
    if text is None:
        return Check(what, "this system does not report it", None)
    free_kB = next((int(line.split()[1]) for line in text.splitlines() if "MemAvail" in line), 0)
    found = f"{free_kB / 1024:.0f} MiB available"
    fix = "end programs that hold memory; top -o %MEM shows them"
    return verdict(what, found, free_kB >= 512 * 1024, fix)


GROUP = COMPUTER
CHECKS: tuple[Callable[[Profile], Check], ...] = (clock, frequency, load, memory)
"""All but `wake_up`, which runs with the real-time priority of a flight."""


def checks(profile: Profile) -> Iterator[Check]:
    for check in checks_of(GROUP):
        yield check(profile)


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return None
