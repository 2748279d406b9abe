"""``kill -9`` in flight: time to zero volts, and the part of the recording that is lost.

The firmware's log holds the times at which its output changed on the host's clock (CLOCK_MONOTONIC,
as the recording's ``host_time_s``). For a flight killed at t:

    zero_s = (first time from which the output stays zero) − (last command before)
    lost_s = t − host_time_s of the last row that `recover` restores
"""

from __future__ import annotations

import os
import random
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.mcap_files.recover import recover
from tests.profiles import PATIENT, START_S, write_profile
from tests.realtime.flight import FlightProcess

EARLIEST_S, LATEST_S = 0.5, 4.0
"""s of flight between which the moments lie; a shorter flight has not half a second to lose"""
TRIES = 5
"""Attempts for a flight that ends before its moment, by the watchdog on a busy machine"""
AT_REST_S = 1.5
"""s until the device's log is read: several times its watchdog and its ramp"""


@dataclass(frozen=True)
class Killed:
    """One flight that was killed."""

    moment_s: float
    """s after its first command"""
    zero_s: float
    """From the last command to zero volts, for good"""
    lost_s: float
    """s of flight that are in no file"""
    rows: int
    """Recovered rows"""


@dataclass(frozen=True)
class Change:
    """A line of the firmware's log: the output from ``t_s`` on."""

    t_s: float
    enabled: bool
    front_V: float
    back_V: float

    @property
    def zero(self) -> bool:
        return self.front_V == 0 and self.back_V == 0


def changes(log: Path) -> list[Change]:
    """The firmware's log so far, without a line that is still being written."""
    text = log.read_text(encoding="ascii") if log.exists() else ""
    result = []
    for line in text[: text.rfind("\n") + 1].splitlines():
        t, enabled, front, back = line.split()
        result.append(Change(float(t), enabled == "1", float(front), float(back)))
    return result


def kill_flights(
    device: str, log: Path, folder: Path, count: int, *, seed: int = 0
) -> Iterator[Killed]:
    """Fly ``count`` times on the firmware that writes ``log``; kill each flight at random."""
    draw = random.Random(seed)
    for i in range(count):
        moment_s = draw.uniform(EARLIEST_S, LATEST_S)
        for _ in range(TRIES):
            killed = kill_one(device, log, folder / f"killed-{i}.mcap", moment_s)
            if killed is not None:
                yield killed
                break
        else:
            raise RuntimeError(f"{TRIES} flights ended before {moment_s:.2f} s: too busy a machine")


def kill_one(device: str, log: Path, output: Path, moment_s: float) -> Killed | None:
    """One flight, killed ``moment_s`` after its first command; None where it ended before."""
    before = len(changes(log))
    profile = write_profile(output.with_suffix(".toml"), **PATIENT)
    with FlightProcess(device, output, 600, profile=profile) as flight:
        deadline = time.monotonic() + START_S
        while not any(not c.zero for c in changes(log)[before:]):
            assert time.monotonic() < deadline, flight.shown.decode(errors="replace")[-3000:]
            assert flight.process.poll() is None, flight.shown.decode(errors="replace")[-3000:]
            time.sleep(0.005)
        time.sleep(moment_s)
        if not in_flight(changes(log)):
            return None
        killed_s = time.monotonic()
        os.kill(flight.process.pid, signal.SIGKILL)
        flight.process.wait()
    time.sleep(AT_REST_S)
    flown = changes(log)[before:]
    zero_s = next(c.t_s for c, after in _with_all_after(flown) if after)
    last_command_s = last_command(flown, killed_s)
    saved = read_recording(recover(output).path)
    return Killed(
        moment_s,
        zero_s - last_command_s,
        killed_s - float(saved.channels["host_time_s"][-1]),
        len(saved),
    )


def in_flight(flown: list[Change]) -> bool:
    """False once the output has been at zero for the last three changes, or is disabled."""
    return flown[-1].enabled and any(not c.zero for c in flown[-3:])


def last_command(flown: list[Change], killed_s: float) -> float:
    """When the last command arrived: the last change before the watchdog's silence."""
    return max(c.t_s for c in flown if c.t_s < killed_s + 0.02)


def _with_all_after(flown: list[Change]) -> Iterator[tuple[Change, bool]]:
    """Each change, and whether the output is zero from it on."""
    still = [False] * len(flown)
    zero = True
    for i in range(len(flown) - 1, -1, -1):
        zero = zero and flown[i].zero
        still[i] = zero
    return zip(flown, still, strict=True)
