"""Stores the time of each emergency stop: a program started before a stop cannot arm after it.

    <runtime>/<name>@<time>.stop      name: a device, a serial number, or ``all``
                                      time: of the stop, ns on the host's monotonic clock

Such a file is the *stamp* of a stop; it contains the reason and the computer's boot identifier. An
*invocation* is what the user started: a program, a call in an interactive interpreter, or a request
to a running program. A flight must not arm the rig if

    start of its invocation ≤ time of a stop of its rig ≤ now

A stop writes its stamp before it looks for sessions (processes that use a rig). A flight creates
its session before it looks for stamps. So either the stop finds the session, or the flight finds
the stamp.

==============================  ==================================================================
invocation                      its start
==============================  ==================================================================
a program: ``heli3dof``, a      when its process started, as the system reports it. All flights of
script                          ``run --auto``, or of a loop in a script, are one invocation
a call in an interactive        when `command_began_ns` is called, at the beginning of a flight
interpreter or a notebook
a request to a program that     when the program last called `start_command`
carries out many requests: a
server, a graphical program
==============================  ==================================================================

The monotonic clock is common to all processes of a computer and is never set. After a restart of
the computer an old stamp has a time in the future or another boot identifier, and is ignored.
"""

from __future__ import annotations

import binascii
import json
import os
import sys
import time
from collections.abc import Iterable
from contextlib import suppress
from datetime import datetime
from pathlib import Path

from heli3dof.rig.session.paths import device_name, runtime_folder

ALL = "all"
_IMPORTED_NS = time.monotonic_ns()
_began_ns: int | None = None


def start_command() -> None:
    """Store the present time as the start of a user's request to this program.

    An emergency stop before this time does not prevent the request's flights; a later stop does. A
    program that carries out many requests, such as a server, calls this function for each request.
    """
    global _began_ns
    _began_ns = time.monotonic_ns()


def command_began_ns() -> int:
    """Return when the present invocation began, in ns on the host's monotonic clock.

    An invocation is what the user started: a program, a call in an interactive interpreter, or a
    request to a running program (`start_command`).
    """
    global _began_ns
    if hasattr(sys, "ps1"):  # an interactive interpreter has a prompt
        return time.monotonic_ns()
    if _began_ns is None:
        _began_ns = min(_IMPORTED_NS, _process_start_ns())
    return _began_ns


def leave_stamp(names: Iterable[str], reason: str) -> None:
    """Store an emergency stop with the present time; no program started earlier can arm the rigs.

    ``names``: the rigs' names from `names_of`, or ``all``. ``reason``: why the rigs were stopped;
    a program that may not arm a rig shows it in its error message.
    """
    folder, now = runtime_folder(), time.monotonic_ns()
    about = {"reason": reason, "at": datetime.now().strftime("%H:%M:%S"), "boot": _boot()}
    for name in names:
        older = list(folder.glob(f"{name}@*.stop"))
        (folder / f"{name}@{now}.stop").write_text(json.dumps(about), encoding="utf-8")
        for stamp in older:  # the new stamp includes them
            with suppress(OSError):
                stamp.unlink()


def stopped_since(began_ns: int, names: Iterable[str]) -> str | None:
    """Return the reason of an emergency stop since ``began_ns``; None if the rig may be armed.

    ``began_ns``: a time in ns on the host's monotonic clock, usually the start of this program
    (`command_began_ns`). ``names``: the rig's names from `names_of`.
    """
    now, wanted = time.monotonic_ns(), {ALL, *names}
    for stamp in runtime_folder().glob("*.stop"):
        name, _, time_ns = stamp.stem.rpartition("@")
        if name not in wanted or not time_ns.isdigit() or not began_ns <= int(time_ns) <= now:
            continue
        try:
            about = json.loads(stamp.read_text(encoding="utf-8"))
        except (OSError, ValueError):  # it is being written, or replaced by a later one
            return "a stop after this command began"
        if about.get("boot") == _boot():
            return f"{about.get('reason')}, at {about.get('at')}"
    return None


def names_of(device: str, serials: Iterable[str] = ()) -> list[str]:
    """Return the names under which the emergency stops of a rig are stored.

    There is one name for its URL ``device``, and one for each possible serial number in
    ``serials``.
    """
    numbers = [f"serial-{binascii.crc32(s.encode()):08x}" for s in serials if s]
    return [device_name(device), *numbers]


def _process_start_ns() -> int:
    """Return when this process started, in ns (monotonic); on Linux up to 10 ms too early.

    On other systems psutil gives the time; it is wrong by any change of the wall clock since the
    start. Without psutil the result is the time at which this module was imported.
    """
    try:
        fields = Path("/proc/self/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        started_ns = int(fields[19]) * 1_000_000_000 // os.sysconf("SC_CLK_TCK")
        age_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - started_ns
    except (OSError, ValueError, IndexError, AttributeError):
        try:
            import psutil
        except ImportError:
            return _IMPORTED_NS
        age_ns = int((time.time() - psutil.Process().create_time()) * 1e9)
    return time.monotonic_ns() - age_ns


def _boot() -> str:
    """Return an identifier of the computer's last start; empty if the system has none."""
    try:
        return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
    except OSError:
        return ""
