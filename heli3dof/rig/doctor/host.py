"""The computer: its clock, how late it wakes up, its cores' frequency, what else it does."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from heli3dof.rig.clock import wait_until
from heli3dof.rig.interface import Check
from heli3dof.rig.profile import Profile

SYSTEM = Path("/sys/devices/system")
QUICK_CLOCKS = ("tsc", "arch_sys_counter", "kvm-clock", "timebase", "riscv_clocksource")
"""Read without leaving the program, or nearly so"""
WAKE_SECONDS = 1.0
LATE_S = 1e-3
RESOLUTION_S = 1e-6


def clock(profile: Profile) -> Check:
    """The clock that deadlines are kept with: its resolution and where it comes from."""
    what = "clock"
    resolution = time.get_clock_info("monotonic").resolution
    source = _text(SYSTEM / "clocksource/clocksource0/current_clocksource")
    found = f"{source or 'of the system'}, resolution {resolution * 1e9:.0f} ns"
    if resolution > RESOLUTION_S:
        # On Windows, Python reads the fine clock since 3.13 only.
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
    """How late this process is at absolute deadlines of the control period, for a second."""
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
    if over > 0.001 * n:
        fix = "end what else runs (top shows it), then permit real-time scheduling (above)"
        return Check("wake-up", found, False, fix)
    return Check("wake-up", found, True)


def frequency(profile: Profile) -> Check:
    """The cores' frequency governors: a core that has clocked down is late."""
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
    """What else this computer does."""
    what = "other work"
    if not hasattr(os, "getloadavg"):
        return Check(what, "this system does not tell", None)
    busy, cores = os.getloadavg()[0], os.cpu_count() or 1
    found = f"{busy:.1f} programs want to run, on {cores} cores"
    if busy > cores - 0.5:
        return Check(what, found, False, "top shows them; end what is not needed in flight")
    return Check(what, found, True)


def memory(profile: Profile) -> Check:
    """Memory that is free: without, pages go to the disk and come back in flight."""
    what = "memory"
    text = _text(Path("/proc/meminfo"))
    if text is None:
        return Check(what, "this system does not tell", None)
    free_kB = next((int(line.split()[1]) for line in text.splitlines() if "MemAvail" in line), 0)
    found = f"{free_kB / 1024:.0f} MiB available"
    if free_kB < 512 * 1024:
        return Check(what, found, False, "end programs that hold memory; top -o %MEM shows them")
    return Check(what, found, True)


CHECKS: tuple[Callable[[Profile], Check], ...] = (clock, frequency, load, memory)
"""`wake_up` is not among them: it is asked with what the system grants a flight."""


def checks(profile: Profile) -> Iterator[Check]:
    """Every check of this file, one after another."""
    for check in CHECKS:
        yield check(profile)


def _text(path: Path) -> str | None:
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return None
