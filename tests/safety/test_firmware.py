"""Rows of docs/reference/safety.md on the firmware in C, a process of its own.

Its log holds every change of its output: CLOCK_MONOTONIC in s, enabled, front and back V.
"""

from __future__ import annotations

import signal
import time
from math import inf
from pathlib import Path

import pytest

from tests.drivers.emulated_rigs import RigProcess, firmware_rig
from tests.profiles import STALL_S, START_S
from tests.safety.bench import Over, never
from tests.safety.table import BY_NAME, DEVICE_RAMP_S
from tests.safety.test_processes import PROFILE, ended, flying, starts_clean

pytestmark = pytest.mark.realtime
WATCHDOG_S = 0.3
BUSY_S = STALL_S + 0.1
"""s by which a busy machine may delay the firmware's process"""


class Firmware:
    """Same attributes as `tests.safety.bench.Bench`."""

    def __init__(self, process: RigProcess, log: Path) -> None:
        self.url = process.url(f"watchdog_s={WATCHDOG_S}")
        self._log = log

    @property
    def lines(self) -> list[tuple[float, ...]]:
        """t, enabled, front V, back V, at every change; the last line may still be written."""
        whole = self._log.read_text().rpartition("\n")[0].splitlines()
        return [tuple(float(word) for word in line.split()) for line in whole]

    @property
    def zero_s(self) -> float:
        """Time from which the output is zero; infinite while it is not."""
        since = inf
        for t, _, *volts in reversed(self.lines):
            if volts != [0.0, 0.0]:
                break
            since = t
        return since

    def wait_until_flying(self, over: Over = never, seconds: float = 0.5) -> None:
        deadline = time.monotonic() + START_S
        while time.monotonic() < deadline and over() is None:
            begun = [t for t, _, front, _ in self.lines if front != 0]
            if begun and time.monotonic() - begun[0] > seconds:
                return
            time.sleep(0.01)
        raise AssertionError("no flight began")


def within(name: str) -> float:
    return BY_NAME[name].zero.seconds(PROFILE, WATCHDOG_S) + BUSY_S


def test_after_kill_9_the_rig_is_at_zero_within_watchdog_and_ramp(tmp_path: Path) -> None:
    with firmware_rig("--log", str(tmp_path / "volts")) as process:
        rig = Firmware(process, tmp_path / "volts")
        with flying(rig, tmp_path) as flight:
            killed_s = time.monotonic()
            flight.process.kill()
            flight.end()
            time.sleep(within("kill_9"))
        assert killed_s < rig.zero_s <= killed_s + within("kill_9")
        # Without steps: between two changes the output falls by no more than the ramp does since
        # the change before them.
        ramp = [(t, front) for t, _, front, _ in rig.lines if t > killed_s]
        slope = max(front for _, front in ramp) / DEVICE_RAMP_S
        for (before_s, _), (_, a), (at_s, b) in zip(ramp, ramp[1:], ramp[2:], strict=False):
            assert 0 <= a - b <= slope * (at_s - before_s) + 1e-3
        starts_clean(rig)


def test_ctrl_c_ramps_the_rig_to_zero(tmp_path: Path) -> None:
    with firmware_rig("--log", str(tmp_path / "volts")) as process:
        rig = Firmware(process, tmp_path / "volts")
        with flying(rig, tmp_path) as flight:
            asked_s = time.monotonic()
            flight.process.send_signal(signal.SIGINT)
            ended("ctrl_c", flight)
        assert asked_s < rig.zero_s <= asked_s + within("ctrl_c")
        starts_clean(rig)


@pytest.mark.parametrize(
    ("name", "drill"),
    [
        ("device_reset", "--reset-after=1"),
        ("amplifier_fault", "--fault-after=1:0.2"),
        ("stalled_motor", "--stall-after=1:0.2"),
        ("button", "--button-after=1"),
    ],
)
def test_a_fault_in_the_device_stops_it(name: str, drill: str, tmp_path: Path) -> None:
    with firmware_rig("--log", str(tmp_path / "volts"), drill) as process:
        rig = Firmware(process, tmp_path / "volts")
        with flying(rig, tmp_path) as flight:
            ended(name, flight)
        volts = [front for _, _, front, _ in rig.lines]
        # To zero in one step, without a ramp or a command.
        assert volts[-1] == 0.0
        assert volts[-2] > 3.0
        starts_clean(rig)
