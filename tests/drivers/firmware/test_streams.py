"""The firmware's stream: over TCP, over a lossy line, and from a process that is held up."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from heli3dof.experiment.control_loop.echo_latency import EchoMeter
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.profile import default_profile
from tests.drivers.firmware.building import rig_program

PROFILE = default_profile()
HELD_UP_S = 0.06
PATIENT = ("--watchdog", "1000", "--with-parent")


@contextmanager
def served(*options: str) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The firmware's process, and its device URL."""
    words = [rig_program(), *PATIENT, *options]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        output = process.stdout.readline().strip()
        try:
            yield process, f"serial+{output}" if "://" in output else f"serial://{output}"
        finally:
            process.kill()


@contextmanager
def armed(url: str) -> Iterator[Any]:
    """A rig over a stream at the profile's rate."""
    rig: Any = open_driver(url, PROFILE)
    try:
        rig.arm()
        yield rig
    finally:
        rig.close()


def fly(rig: Any, periods: int) -> float:
    """Periods at zero volts; s on the device's clock from the first sample to the last."""
    times = [rig.exchange(Command(k, 0.0, 0.0), 0.0).device_time_s for k in range(1, periods + 1)]
    return float(times[-1] - times[0])


@pytest.mark.realtime
def test_a_held_up_process_skips_samples_and_the_line_loses_none() -> None:
    with served() as (process, url), armed(url) as rig:
        fly(rig, 20)
        before = rig.statistics.device_skipped
        os.kill(process.pid, signal.SIGSTOP)
        time.sleep(HELD_UP_S)
        os.kill(process.pid, signal.SIGCONT)
        fly(rig, 20)
        # Two periods of tolerance: the stop begins and ends within a period.
        assert rig.statistics.device_skipped - before >= HELD_UP_S / PROFILE.dt - 2
        assert rig.statistics.lost == 0


@pytest.mark.realtime
def test_a_line_that_loses_bytes_loses_samples() -> None:
    with served("--drop", "0.003", "--seed", "3") as (_, url), armed(url) as rig:
        fly(rig, 300)
        assert rig.statistics.lost > 0
        assert rig.statistics.malformed > 0


@pytest.mark.realtime
def test_every_period_is_accounted_for() -> None:
    with served("--drop", "0.003", "--seed", "4") as (_, url), armed(url) as rig:
        first = rig.exchange(Command(1, 0.0, 0.0), 0.0)
        counts = rig.statistics
        before = counts.lost + counts.device_skipped + counts.samples_stale
        last = [rig.exchange(Command(k, 0.0, 0.0), 0.0) for k in range(2, 302)][-1]
        skipped = counts.lost + counts.device_skipped + counts.samples_stale - before
        passed = (last.device_time_s - first.device_time_s) / PROFILE.dt
        assert abs(passed - (300 + skipped)) < 1, "either end may be late by less than a period"


@pytest.mark.realtime
def test_over_tcp_hosts_are_served_one_after_another() -> None:
    with served("--tcp", "0") as (_, url):
        assert url.startswith("serial+socket://127.0.0.1:")
        for _ in range(2):
            with armed(url) as rig:
                assert rig.identity.timebase == "device"
                assert fly(rig, 50) >= 49 * PROFILE.dt - 1e-3
                assert rig.statistics.lost == 0
                rig.estop("test")
                assert rig.read().flags & Flags.ESTOP


def test_the_file_of_late_samples_exists_from_the_start(tmp_path: Path) -> None:
    with served("--late", str(tmp_path / "late")):
        assert (tmp_path / "late").read_text() == ""


def test_a_port_in_use_is_an_error() -> None:
    with served("--tcp", "0") as (_, url):
        port = url.rpartition(":")[2]
        output = subprocess.run([rig_program(), "--tcp", port], capture_output=True, text=True)
        assert output.returncode == 3
        assert "no port: Address already in use" in output.stderr


@pytest.mark.realtime
@pytest.mark.parametrize("delay_ms", [5, 25])
def test_a_constant_delay_is_measured_through_the_echo(delay_ms: int) -> None:
    with served("--delay", str(delay_ms)) as (_, url), armed(url) as rig:
        meter = EchoMeter(PROFILE.dt)
        for k in range(1, 201):
            sent_s = time.monotonic()
            sample = rig.exchange(Command(k, 0.0, 0.0), sent_s + PROFILE.dt)
            meter.exchanged(k, sent_s, sample)
        latency = meter.latency
        # Both ways, then up to a period until the device's next sample.
        shortest_s = 2e-3 * delay_ms
        assert shortest_s <= latency.quantile_s(0.1)
        assert shortest_s <= latency.quantile_s(0.5) <= shortest_s + 4 * PROFILE.dt
        assert rig.statistics.delay.quantile_s(0.5) < PROFILE.dt + 1e-3, "modulo the period"
        assert rig.statistics.commands_unacknowledged >= 190
