"""``estop`` stops flights of other processes and lists the stopped rigs."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from heli3dof.errors import DeviceError
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.row import RAMP_DOWN
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.client import Running, running, state
from heli3dof.rig.session.open_exclusive import open_rig
from heli3dof.rig.session.server import Session
from heli3dof.rig.url import DeviceUrl
from tests.cli.running import heli3dof
from tests.profiles import END_S, PATIENT, START_S, write_profile
from tests.rig.fakes import FakeDriver, only_drivers

MOCK = "mock:?watchdog_s=5&start=level"
"""In real time, with a watchdog long enough for a busy machine."""


def wait_for_flight(flight: subprocess.Popen[str]) -> Running:
    deadline = time.monotonic() + START_S
    result: dict[int, object] = {}
    while time.monotonic() < deadline:
        assert flight.poll() is None, flight.communicate()
        for session in running():
            result[session.pid] = now = state(session, 5) or {}
            if session.pid == flight.pid and now.get("phase") == "flying":
                return session
        time.sleep(0.02)
    raise AssertionError(f"no flight began: {result}")


@pytest.mark.realtime
def test_a_flight_is_stopped_from_another_terminal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heli3dof.rig.session.estop.PATIENCE_S", 10.0)  # the machine may be busy
    path = tmp_path / "flight.mcap"
    profile = write_profile(tmp_path / "rig.toml", **PATIENT)
    words = ["run-step", "--roll", "5", "--device", MOCK, "-o", str(path)]
    words += ["--profile", str(profile)]
    run = [sys.executable, "-m", "heli3dof", *words]
    with subprocess.Popen(run, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as flight:
        wait_for_flight(flight)
        time.sleep(0.3)
        result = heli3dof("estop", "--reason", "it smells", "--json")
        _, err = flight.communicate(timeout=END_S)
    assert result.code == 0
    (stopped,) = result.document["stopped"]
    assert f"pid {flight.pid}" in stopped["how"]
    assert flight.returncode == 4
    assert "it smells" in err
    recording = read_recording(path)
    assert recording.meta["outcome"] == "tripped"
    assert recording.meta["outcome_details"]["detail"] == "emergency stop on request: it smells"
    stop = np.flatnonzero(recording.channels["flags"].astype(int) & Flags.ESTOP)
    assert len(stop)
    assert np.all(recording.voltage[stop] == 0)
    assert recording.channels["phase"][-1] == RAMP_DOWN


def test_estop_stops_the_device_of_a_session_that_hangs(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    with Session("fake://1", doing="heli3dof run rich"):
        result = heli3dof("estop", "--device", "fake://1")
    assert result.code == 0
    assert driver.stops == ["fake://1"]
    assert "did not answer; the device said that it stopped" in result.out


def test_estop_stops_devices_without_a_session(monkeypatch: pytest.MonkeyPatch) -> None:
    driver = FakeDriver(urls=("fake://1", "fake://2"))
    only_drivers(monkeypatch, fake=driver, broken=ImportError("no such library"))
    assert heli3dof("estop", "--json").document["schema"] == "heli3dof.estop/1"
    assert driver.stops == ["fake://1", "fake://2"]


DEAF = "no answer within 0.1 s"


def test_a_flight_that_does_not_stop_is_an_error_and_the_others_stop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    deaf, well = FakeDriver(cannot_stop=DEAF), FakeDriver(urls=("well://1",))
    only_drivers(monkeypatch, fake=deaf, well=well)
    with Session("fake://1", doing="heli3dof run rich"):
        result = heli3dof("estop")
    assert result.code == 3
    assert well.stops == ["well://1"]
    assert "Stopped well://1" in result.out
    assert "NOT STOPPED: fake://1" in result.err
    assert DEAF in result.err
    assert "switch off the amplifier" in result.err


def test_a_port_without_a_session_may_stay_unconfirmed(monkeypatch: pytest.MonkeyPatch) -> None:
    deaf, well = FakeDriver(cannot_stop=DEAF), FakeDriver(urls=("well://1",))
    only_drivers(monkeypatch, fake=deaf, well=well)
    result = heli3dof("estop", "--json")
    assert result.code == 0
    assert [s["device"] for s in result.document["stopped"]] == ["well://1"]
    assert result.document["unconfirmed"] == [{"device": "fake://1", "why": DEAF}]
    assert "fake://1 did not confirm" in result.err


class Ports(FakeDriver):
    """Finds ports that may not be rigs, like the serial driver."""

    def is_rig(self, url: DeviceUrl) -> bool:
        return url.where == "3"

    def persistent_name(self, url: DeviceUrl) -> str:
        return f"board {url.where}"


def test_a_port_is_skipped_until_a_rig_was_opened_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = Ports(urls=("fake://1", "fake://2", "fake://3"))
    only_drivers(monkeypatch, fake=driver)
    with open_rig("fake://2", default_profile()):
        pass
    result = heli3dof("estop", "--json")
    assert result.code == 0
    assert driver.stops == ["fake://2", "fake://3"]
    assert result.document["left_out"] == ["fake://1"]
    assert "heli3dof estop --device fake://1" in result.err


def test_estop_reaches_unlisted_ports_at_which_a_rig_was_opened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = Ports(urls=())
    only_drivers(monkeypatch, fake=driver)
    with open_rig("fake://host:5000?speed=1", default_profile()):
        pass
    assert heli3dof("estop").code == 0
    assert driver.stops == ["fake://host:5000?speed=1"]


def test_estop_fails_if_every_port_is_skipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = Ports()
    only_drivers(monkeypatch, fake=driver)
    result = heli3dof("estop")
    assert result.code == 3
    assert driver.stops == []
    assert "No rig was stopped" in result.err
    assert "heli3dof estop --device fake://1" in result.err
    assert heli3dof("estop", "--device", "fake://1").code == 0
    assert driver.stops == ["fake://1"]


@pytest.mark.parametrize("words", [(), ("--device", "fake://1")])
def test_estop_fails_if_no_device_confirms(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    only_drivers(monkeypatch, fake=FakeDriver(cannot_stop=DEAF))
    result = heli3dof("estop", *words)
    assert result.code == 3
    assert "NOT STOPPED: fake://1" in result.err


def test_estop_stops_devices_if_sessions_cannot_be_read(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def strangers(device: str | None) -> list[Running]:
        raise DeviceError("the folder belongs to somebody else")

    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    monkeypatch.setattr("heli3dof.rig.session.estop.recorded_sessions", strangers)
    assert heli3dof("estop").code == 0
    assert driver.stops == ["fake://1"]


def test_estop_fails_without_any_rig(monkeypatch: pytest.MonkeyPatch) -> None:
    only_drivers(monkeypatch, fake=FakeDriver(urls=()))
    result = heli3dof("estop", "--json")
    assert result.code == 3
    assert "No rig was stopped" in result.document["error"]


def test_an_unknown_device_is_a_usage_error() -> None:
    assert heli3dof("estop", "--device", "serail:///dev/ttyACM0").code == 2
