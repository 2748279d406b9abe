"""An emergency stop reaches the device: an emulated rig behind a pseudo-terminal."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.client import running, state
from tests.cli.running import heli3dof
from tests.profiles import END_S, PATIENT, START_S, write_profile
from tests.rig.processes import suspend

EMULATED_RIG = [sys.executable, "-m", "heli3dof_drivers.emulator.transport_pty", "--with-parent"]
pytestmark = pytest.mark.realtime


@pytest.fixture
def device() -> Iterator[str]:
    """A rig held level with a long watchdog for busy machines: only a stop ends its volts."""
    rig = [*EMULATED_RIG, "--device", "mock:?noise=0&start=level"]
    with subprocess.Popen(rig, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield f"serial://{process.stdout.readline().strip()}?watchdog_s=1"
        process.kill()


@pytest.fixture
def flight(device: str, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    profile = write_profile(tmp_path / "rig.toml", **PATIENT)
    words = ["run-step", "--roll", "3", "--device", device, "-o", str(tmp_path / "flight.mcap")]
    words += ["--profile", str(profile)]
    run = [sys.executable, "-m", "heli3dof", *words, "--json"]
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as flying:
        deadline = time.monotonic() + START_S
        while not any((state(s, 5) or {}).get("phase") == "flying" for s in running(device)):
            assert time.monotonic() < deadline, "no flight began"
            assert flying.poll() is None, flying.communicate()
            time.sleep(0.05)
        time.sleep(0.3)
        yield flying
        flying.kill()


def is_stopped(device: str) -> bool:
    rig = open_driver(device, default_profile())
    sample = rig.read()
    rig.close()
    return bool(sample.flags & Flags.ESTOP) and sample.v_applied == (0.0, 0.0)


def test_a_flight_is_stopped_through_its_session(device, flight, monkeypatch):
    monkeypatch.setattr("heli3dof.rig.session.estop.PATIENCE_S", 10.0)  # the machine may be busy
    result = heli3dof("estop", "--device", device, "--json")
    (stopped,) = result.document["stopped"]
    assert f"pid {flight.pid}" in stopped["how"]
    out, err = flight.communicate(timeout=END_S)
    assert flight.returncode == 4, err
    assert json.loads(out)["outcome"] == "tripped"
    assert is_stopped(device)


def test_a_hanging_flight_is_stopped_directly(device, flight):
    suspend(flight)
    result = heli3dof("estop", "--device", device)
    assert result.code == 0
    assert "did not answer" in result.out
    flight.kill()
    flight.wait()
    assert is_stopped(device)


def test_a_second_flight_is_refused_and_the_first_continues(device, flight, tmp_path):
    other = tmp_path / "other.mcap"
    result = heli3dof("run-step", "--roll", "3", "--device", device, "-o", other)
    assert result.code == 3
    assert f"pid {flight.pid} runs `" in result.err
    assert not other.exists()
    assert flight.poll() is None


def test_a_stopped_rig_flies_again(device, tmp_path):
    assert heli3dof("estop", "--device", device).code == 0
    assert is_stopped(device)
    profile = write_profile(tmp_path / "rig.toml", **PATIENT)
    short = ("--settle", "0.2", "--duration", "0.3", "-o", tmp_path / "again.mcap")
    short += ("--profile", profile)
    assert heli3dof("run-step", "--roll", "1", "--device", device, *short).code == 0
