"""Faults inside the flight's process from a given moment on: the host's half of the table.

``python -m tests.safety.sabotage KIND@SECONDS STAMP run-step …`` runs the command line with one
fault (``none``: without). Seconds count from the first control period. The file STAMP gets a line
``event`` or ``noticed`` (by a safety monitor or the recorder), with CLOCK_MONOTONIC in s.
"""

from __future__ import annotations

import errno
import os
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from math import degrees, nan
from pathlib import Path
from typing import Any

from heli3dof.errors import NoSpace
from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.experiment.control_loop.loop import _Flight
from heli3dof.experiment.safety_monitors import host_suspend
from heli3dof.experiment.safety_monitors.amplifier_output import AmplifierOutput
from heli3dof.model.control.controller import Controller
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.mcap_writer import McapFile
from heli3dof.recording.row import Row
from heli3dof.rig.envelope import Envelope
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import Profile, default_profile, profile_from_dict

KINDS = ("none", "exception", "nan", "limit", "envelope", "late", "disk", "sleep", "amplifier")
LATE_S = 0.04
"""s by which every period is late: two thirds of the periods of such a flight are late"""
SLEPT_S = 600.0
Due = Callable[[], bool]
Stamp = Callable[[str], None]
Put = Callable[[Any, str, Any], None]


def sabotage(kind: str, due: Due, stamp: Stamp, put: Put = setattr, halt: bool = False) -> None:
    """Install the fault ``kind``, which begins once ``due`` returns True.

    ``stamp`` is called with "event" at its beginning, and with "noticed" if only the faulty code
    knows when the loop detects it. ``halt``: a sleeping computer also stops this process until
    SIGCONT.
    """
    began: list[str] = []

    def on() -> bool:
        if due() and not began:
            began.append(kind)
            stamp("event")
        return bool(began)

    if kind in ("exception", "nan", "limit"):
        put(Controller, "step", _controller(kind, on))
    elif kind == "envelope":
        _narrow_envelope(on, put)
    elif kind == "late":
        _each_period(lambda: time.sleep(LATE_S) if on() else None, put)
    elif kind == "disk":
        _fill_disk(on, stamp, put)
    elif kind == "sleep":
        _sleep(on, halt, put)
    elif kind == "amplifier":
        _lose_enabled(on, put)
    elif kind != "none":
        raise ValueError(f"no sabotage {kind!r}: {KINDS}")


def stamp_reports(stamp: Stamp, put: Put = setattr) -> None:
    """Call ``stamp`` with "noticed" in the period in which a safety monitor reports."""

    judge = _Flight.judge

    def judged(self: _Flight, *period: Any) -> str | None:
        report = judge(self, *period)
        if report is not None:
            stamp("noticed")
        return report

    put(_Flight, "judge", judged)


def _controller(kind: str, on: Due) -> Callable[..., object]:
    real = Controller.step

    def step(self: Controller, *a: Any) -> object:
        command, voltage = real(self, *a)[-2:]
        if not on():
            return command, voltage
        if kind == "exception":
            return 1 / 0
        if kind == "nan":
            return (nan, nan), (nan, nan)
        v_max = default_profile().motor.v_max
        return (2 * v_max, 2 * v_max), (v_max, v_max)

    return step


def _narrow_envelope(on: Due, put: Put) -> None:
    """Lower the envelope's roll limit below the present roll."""
    profiles: dict[int, Profile] = {}
    start, check = Envelope.__init__, Envelope.check

    def remembered(self: Envelope, profile: Profile) -> None:
        profiles[id(self)] = profile
        start(self, profile)

    def narrowed(self: Envelope, t: float, angle: Any, *rest: Any) -> str | None:
        if not on():
            return check(self, t, angle, *rest)
        given = profiles[id(self)].to_dict()
        given["limits"]["roll_max_deg"] = degrees(angle[0]) - 0.1
        return check(Envelope(profile_from_dict(given)), t, angle, *rest)

    put(Envelope, "__init__", remembered)
    put(Envelope, "check", narrowed)


def _lose_enabled(on: Due, put: Put) -> None:
    """Show the monitor of the amplifier samples without the flag ENABLED."""
    judge = AmplifierOutput.__call__

    def judged(self: AmplifierOutput, now: Period) -> str | None:
        if on():
            off = replace(now.sample, flags=now.sample.flags & ~Flags.ENABLED)
            now = now._replace(sample=off)
        return judge(self, now)

    put(AmplifierOutput, "__call__", judged)


def _each_period(what: Callable[[], object], put: Put) -> None:
    """Call ``what`` whenever the recorder gets a period, those of the ramp included."""
    append = RecordingWriter.append

    def appended(self: RecordingWriter, row: Row) -> None:
        append(self, row)
        what()

    put(RecordingWriter, "append", appended)


def _fill_disk(on: Due, stamp: Stamp, put: Put) -> None:
    write, append = McapFile.write_chunk, RecordingWriter.append

    def write_chunk(self: McapFile, data: bytes) -> None:
        if on():
            raise OSError(errno.ENOSPC, "No space left on device")
        write(self, data)

    def appended(self: RecordingWriter, row: Row) -> None:
        on()
        try:
            append(self, row)
        except NoSpace:
            stamp("noticed")
            raise

    put(McapFile, "write_chunk", write_chunk)
    put(RecordingWriter, "append", appended)


def _sleep(on: Due, halt: bool, put: Put) -> None:
    """As in `tests.safety.test_in_process`: boottime goes on, and monotonic does not."""
    real = host_suspend.ahead_s
    slept: list[float] = []

    def maybe() -> None:
        if not slept and on():
            slept.append(SLEPT_S)
            if halt:
                os.kill(os.getpid(), signal.SIGSTOP)

    put(host_suspend, "ahead_s", lambda: real() + sum(slept))
    _each_period(maybe, put)


def main(what: str, path: str, words: list[str]) -> None:
    """Run the command line with the fault."""
    from heli3dof.cli.app import main as command_line

    kind, _, seconds = what.partition("@")
    began: list[float] = []

    def due() -> bool:
        now = time.monotonic()
        began[:] = began or [now]
        return now - began[0] >= float(seconds)

    def stamp(what: str) -> None:
        with Path(path).open("a") as file:
            file.write(f"{what} {time.monotonic():.6f}\n")

    sabotage(kind, due, stamp, halt=True)
    stamp_reports(stamp)
    sys.argv = ["heli3dof", *words]
    command_line()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
