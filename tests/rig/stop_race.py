"""An emergency stop against a flight that is just starting: is the rig armed after it is confirmed?

    0 ──▶ heli3dof run-step starts ──▶ moment_s: stop ──▶ confirmed ──▶ the flight ends
                                                              └─ from here on, never enabled

The behaviour of the device is read from the device itself: the firmware's log of its output stage,
and the samples of the emulated rig inside the flight's process. All times are the host's monotonic
clock.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from heli3dof.errors import RecordingError
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.interface import Flags
from heli3dof.rig.session.estop import request_estop
from tests.drivers.emulated_rigs import firmware_rig
from tests.profiles import END_S, PATIENT, write_profile

OWN = ("XDG_RUNTIME_DIR", "XDG_STATE_HOME")


@dataclass(frozen=True)
class Race:
    """One flight and the stop that came ``moment_s`` after its process was started."""

    moment_s: float
    asked: str
    """Target of the stop: every rig, or a device"""
    confirmed: bool
    """False: no rig was there to be stopped yet"""
    seconds: float
    """s that the stop took"""
    enabled_after_s: float
    """s for which the device was enabled after the stop had returned"""
    was_enabled: bool
    """Before the stop"""
    code: int
    """The flight's exit code"""


def race(kind: str, moment_s: float, *, everything: bool) -> Race:
    """One race against ``kind``, mock or firmware; ``everything``: the stop names no device."""
    with _own_folders() as folder:
        log = folder / "volts"
        if kind == "firmware":
            with firmware_rig("--log", str(log)) as rig:
                return _race(rig.url("watchdog_s=1"), moment_s, folder, log, everything)
        return _race("mock:?watchdog_s=1", moment_s, folder, None, everything)


def _race(device: str, moment_s: float, folder: Path, log: Path | None, everything: bool) -> Race:
    path = folder / "flight.mcap"
    command = [
        sys.executable, "-m", "heli3dof", "run-step", "--roll", "3", "--settle", "2",
        "--duration", "1", "--device", device, "-o", str(path),
        "--profile", str(write_profile(folder / "rig.toml", **PATIENT)),
    ]  # fmt: skip
    start = time.monotonic()
    quiet = subprocess.DEVNULL
    with subprocess.Popen(command, stdout=quiet, stderr=quiet) as flight:
        time.sleep(max(0.0, start + moment_s - time.monotonic()))
        asked_s = time.monotonic()
        result = request_estop(None if everything else device, "a race")
        stopped = result.stopped + result.unconfirmed
        confirmed_s = time.monotonic()
        code = flight.wait(END_S)
    enabled = _of_log(log) if log else _of_recording(path)
    return Race(
        moment_s,
        "every rig" if everything else "the device",
        bool(stopped) and all(each.done for each in stopped),
        confirmed_s - asked_s,
        sum(max(0.0, until - max(since, confirmed_s)) for since, until in enabled),
        any(since < asked_s for since, _ in enabled),
        code,
    )


def _of_log(path: Path) -> list[tuple[float, float]]:
    """When the firmware's output stage was enabled: from and until."""
    rows = [line.split() for line in path.read_text().splitlines()]
    times = [float(row[0]) for row in rows] + [time.monotonic()]
    return [(times[k], times[k + 1]) for k, row in enumerate(rows) if row[1] != "0"]


def _of_recording(path: Path) -> list[tuple[float, float]]:
    """When the samples reported that the amplifier was enabled."""
    try:
        channels = read_recording(path).channels
    except RecordingError:
        return []  # the flight ended before its first sample
    enabled = channels["flags"].astype(int) & Flags.ENABLED != 0
    times = channels["host_time_s"][enabled]
    return [(float(times[0]), float(times[-1]))] if len(times) else []


@contextmanager
def _own_folders() -> Iterator[Path]:
    """Sessions of its own, in this process and below: a stop of every rig is for these only."""
    before = {name: os.environ.get(name) for name in OWN}
    with tempfile.TemporaryDirectory() as folder:
        os.environ.update(dict.fromkeys(OWN, folder))
        try:
            yield Path(folder)
        finally:
            for name, value in before.items():
                if value is None:
                    del os.environ[name]
                else:
                    os.environ[name] = value
