"""``devices``, ``doctor``, ``zero`` and ``monitor``: their output and files. None arms the rig."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from heli3dof.axes import AXES
from heli3dof.cli.monitor_state import MonitorState
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.rig.calibration import load_calibration
from heli3dof.rig.doctor import folder, host, link
from heli3dof.rig.drivers import load_driver
from heli3dof.rig.interface import Check, Flags
from heli3dof.rig.session.client import running
from heli3dof.rig.session.server import Session
from tests.cli.running import Utf8, heli3dof
from tests.profiles import END_S
from tests.rig.fakes import IDENTITY, FakeDriver, only_drivers

HEAVY = ("numpy", "scipy", "numba", "mcap", "matplotlib")


@pytest.fixture
def fake(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> FakeDriver:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    return driver


@pytest.fixture
def sound(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the checks of this computer, whose result does not concern the test."""
    monkeypatch.setattr(host, "CHECKS", ())
    monkeypatch.setattr(host, "wake_up", lambda profile: Check("wake-up", "in time", True))
    monkeypatch.setattr(folder, "CHECKS", ())
    monkeypatch.setattr(link, "EVERY_S", 0.0)
    timeless = tuple(check for check in link.CHECKS if check is not link.round_trip)
    monkeypatch.setattr(link, "CHECKS", timeless)
    skipped = Check("of the system", "skipped", None)
    monkeypatch.setattr(
        "heli3dof.experiment.control_loop.realtime_priority._scheduling", lambda *_: skipped
    )
    monkeypatch.setattr(
        "heli3dof.experiment.control_loop.realtime_priority._memory", lambda *_: skipped
    )


@pytest.mark.parametrize("words", ["--help", "devices", "estop --device mock:"])
def test_quick_verbs_import_nothing_heavy(words: str) -> None:
    code = (
        "import sys; from heli3dof.cli.app import app\n"
        f"try: app({words.split()!r})\n"
        "except SystemExit: pass\n"
        f"print([m for m in {HEAVY!r} if m in sys.modules], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "[]"


def test_devices_lists_every_driver_and_warns_of_a_broken_one(monkeypatch) -> None:
    only_drivers(
        monkeypatch, fake=FakeDriver(urls=("fake://1", "fake://2")), torn=ImportError("no libfoo")
    )
    result = heli3dof("devices", "--json")
    assert result.code == 0
    drivers = {d["driver"]: d for d in result.document["drivers"]}
    assert drivers["fake"]["devices"] == ["fake://1", "fake://2"]
    assert "no libfoo" in drivers["torn"]["problem"]
    assert "Warning: the driver torn does not load" in result.err


def test_devices_opens_rigs_only_with_probe(fake: FakeDriver) -> None:
    heli3dof("devices")
    assert fake.rigs == []
    (rig,) = heli3dof("devices", "--probe", "--json").document["rigs"]
    assert rig["identity"]["serial"] == "F-1"
    assert rig["rest"]["known_from"] == "power-up"
    assert fake.rigs[0].armed == 0


def test_devices_shows_which_process_uses_a_rig(fake: FakeDriver) -> None:
    with Session("fake://1", doing="heli3dof run rich"):
        result = heli3dof("devices", "--probe", "--json")
    assert result.document["rigs"][0]["held_by"] == result.document["sessions"][0]["pid"]
    assert fake.rigs == []


@pytest.mark.parametrize("urls", [(), ("fake://1",), ("fake://2",)])
def test_devices_prints_each_session_once(fake: FakeDriver, urls: tuple[str, ...]) -> None:
    fake.urls = urls
    with Session("fake://1", doing="heli3dof run rich"):
        shown = heli3dof("devices").out
    assert shown.count("heli3dof run rich") == shown.count("fake://1") == 1
    assert "no rig found" not in shown


@pytest.mark.usefixtures("sound")
def test_doctor_passes_a_good_rig(fake: FakeDriver) -> None:
    result = heli3dof("doctor")
    assert result.code == 0
    assert "fake://1, profile table-1" in result.out
    assert "No check failed." in result.out
    assert fake.rigs[0].armed == 0


@pytest.mark.usefixtures("sound")
def test_doctor_passes_the_emulated_rig() -> None:
    result = heli3dof("doctor", "--device", "mock:", "--json")
    assert [c for c in result.document["checks"] if c["good"] is False] == []


@pytest.mark.usefixtures("sound")
def test_doctor_warns_of_a_busy_computer_and_passes(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(host, "CHECKS", (host.load,))
    monkeypatch.setattr(host.os, "getloadavg", lambda: (99.0, 0.0, 0.0))
    result = heli3dof("doctor")
    assert "WARN  other work: 99.0 programs" in result.out
    assert result.code == 0


@pytest.mark.usefixtures("sound")
def test_doctor_prints_how_to_correct_a_failure_and_exits_with_6(fake: FakeDriver) -> None:
    fake.checks = [Check("latency timer", "16 ms", False, "echo 1 | sudo tee /sys/x")]
    result = heli3dof("doctor")
    assert result.code == 6
    assert "FAIL  latency timer: 16 ms\n      → echo 1 | sudo tee /sys/x" in result.out
    document = heli3dof("doctor", "--json").document
    assert document["exit_code"] == 6
    assert [c["what"] for c in document["checks"] if c["good"] is False] == ["latency timer"]


@pytest.mark.usefixtures("sound")
def test_doctor_exits_with_3_if_the_rig_does_not_open_and_prints_the_other_checks(
    fake: FakeDriver,
) -> None:
    fake.checks = [Check("permission", "this user may not open it", False, "sudo usermod …")]
    with Session("fake://1", doing="heli3dof run rich"):
        result = heli3dof("doctor", "--json")
    assert result.code == 3
    checks = result.document["checks"]
    assert checks[0]["what"] == "permission"
    assert "busy" in checks[-1]["found"]
    assert "; likely cause: " in checks[-1]["found"]
    assert result.document["opened"] is False


@pytest.mark.usefixtures("sound")
def test_doctor_reports_a_rig_that_stops_answering(fake: FakeDriver) -> None:
    fake.silent_after = link.POLLS // 2
    result = heli3dof("doctor", "--json")
    assert result.code == 3
    assert "does not answer" in result.document["checks"][-1]["found"]


@pytest.mark.usefixtures("sound")
def test_a_quiet_doctor_prints_failures_only(fake: FakeDriver) -> None:
    assert heli3dof("doctor", "--quiet").err == ""
    fake.counts = (0, 2**30, 0)
    result = heli3dof("doctor", "--quiet")
    assert result.code == 6
    assert result.out == ""
    (line,) = result.err.splitlines()
    assert line.startswith("rest angles: ")
    assert "Try: switch the device off" in line


@pytest.mark.usefixtures("sound")
def test_zero_reports_a_file_that_cannot_be_written(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("heli3dof.rig.zero.MEASURE_S", 0.05)
    (tmp_path / "file").touch()
    for place in (tmp_path / "file", Path("/proc/heli3dof")):
        monkeypatch.setenv("XDG_STATE_HOME", str(place))
        result = heli3dof("zero")
        assert result.code == 2
        assert f"{place}/heli3dof/rigs/F-1.toml cannot be written" in result.err
        assert "set XDG_STATE_HOME to a folder of your own" in result.err
        assert heli3dof("doctor").code == 0, "a missing calibration is no failure"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(Path, "home", no_home)
    result = heli3dof("zero")
    assert result.code == 2
    assert "set HOME or XDG_STATE_HOME" in result.err
    assert heli3dof("doctor").code == 0
    assert fake.rigs[0].armed == 0


def no_home() -> Path:
    raise RuntimeError("Could not determine home directory.")


def test_doctor_checks_the_emulated_rig() -> None:
    result = heli3dof("doctor", "--device", "mock:", "--json")
    assert result.code in (0, 6)
    assert {c["group"] for c in result.document["checks"]} == {"computer", "recordings", "rig"}


def test_flights_use_the_rest_counts_that_zero_stored(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake.counts = (12, -3, 40)
    monkeypatch.setattr("heli3dof.rig.zero.MEASURE_S", 0.05)
    result = heli3dof("zero", "--json")
    assert result.code == 0
    assert result.document["counts_at_rest"] == [12, -3, 40]
    assert load_calibration("F-1") is not None
    assert (
        heli3dof("devices", "--probe", "--json").document["rigs"][0]["rest"]["known_from"] == "zero"
    )
    flight = fly_plan(step_plan((0.0, None, None), settle_s=0, duration_s=0.1), device="fake://1")
    assert flight.recording.meta["rest"] == {"counts_at_rest": [12, -3, 40], "known_from": "zero"}
    assert flight.recording.angle[0].round(9).tolist() == [-0.479965544, 0, 0]  # −27.5°
    assert fake.rigs[0].armed == 0


def test_a_dry_run_of_zero_stores_nothing(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heli3dof.rig.zero.MEASURE_S", 0.05)
    assert heli3dof("zero", "--dry-run").code == 0
    assert load_calibration("F-1") is None


@pytest.mark.usefixtures("own_clock")
def test_zero_refuses_a_rig_that_moves(fake: FakeDriver) -> None:
    fake.script = {3: {"counts": (0, 30, 0)}}
    result = heli3dof("zero")
    assert result.code == 6
    assert "pitch moved by 2.64°" in result.err
    assert load_calibration("F-1") is None


def test_a_flight_warns_that_the_device_restarted_since_zero(
    fake: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heli3dof.rig.zero.MEASURE_S", 0.05)
    heli3dof("zero")
    fake.identity = replace(IDENTITY, boot=8)
    warnings: list[str] = []
    plan = step_plan((0.0, None, None), settle_s=0, duration_s=0.1)
    flight = fly_plan(plan, device="fake://1", warn=warnings.append)
    assert "has restarted" in warnings[0]
    assert "has restarted" in flight.recording.meta["warnings"][0]
    assert flight.recording.meta["rest"]["known_from"] == "power-up"


def test_several_rigs_without_device_option_is_a_usage_error(fake: FakeDriver) -> None:
    fake.urls = ("fake://1", "fake://2")
    result = heli3dof("monitor", "--seconds", "0")
    assert result.code == 2
    assert "--device fake://1" in result.err


def test_the_default_device_is_the_emulated_rig_with_a_note(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    only_drivers(monkeypatch, fake=FakeDriver(urls=()), mock=load_driver("mock"))
    result = heli3dof("monitor", "--seconds", "0", "--json")
    assert result.code == 0
    assert result.document["readings"] == 1
    assert "No rig was found" in result.err
    assert "mock:" in result.err


def test_an_emulated_rig_of_the_device_variable_needs_no_note(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HELI3DOF_DEVICE", "mock:")
    result = heli3dof("monitor", "--seconds", "0")
    assert result.code == 0
    assert "No rig was found" not in result.err


@pytest.mark.usefixtures("own_clock")
def test_monitor_reads_a_free_rig_and_never_arms_it(fake: FakeDriver) -> None:
    fake.counts = (313, 0, 0)
    result = heli3dof("monitor", "--seconds", "1", "--json")
    assert result.code == 0
    document = result.document
    assert document["readings"] == 10, "10 Hz, and a reading takes time too"
    assert document["last"]["roll_deg"] == pytest.approx(0, abs=0.05)
    assert document["pid"] is None
    assert "not enabled" in result.err
    assert fake.rigs[0].armed == 0
    assert fake.closed == 1


def test_monitor_shows_a_session_without_opening_its_rig(fake: FakeDriver) -> None:
    with Session("fake://1", doing="heli3dof run rich") as session:
        angle = iter(range(1000))
        session.state = lambda: {
            "device_time_s": (k := next(angle)) * 0.1,
            "roll_deg": 2.0 * k,
            "pitch_deg": 0.0,
            "yaw_deg": 0.0,
            "v_front_V": 7.0,
            "v_back_V": 7.1,
            "flags": [Flags.ENABLED.name],
            "lateness_s": 0.002,
            "phase": "flying",
            "late": 3,
        }
        result = heli3dof("monitor", "--device", "fake://1", "--seconds", "1", "--json")
    document = result.document
    assert document["doing"] == "heli3dof run rich"
    assert document["rate_deg_per_s"]["roll"] == pytest.approx(20)
    assert document["flags_seen"] == ["ENABLED"]
    assert document["worst_lateness_s"] == 0.002
    assert "front  +7.00 V" in result.err
    assert "flying, 3 periods late" in result.err
    assert fake.rigs == []


def test_monitor_selects_the_session_of_a_mock_by_its_options() -> None:
    with (
        Session("mock:?seed=0", private=True, doing="heli3dof run rich"),
        Session("mock:?fault=none&seed=0", private=True, doing="heli3dof run steps"),
    ):
        of = {url: _watched(url) for url in ("mock:?fault=none", "mock:?seed=0&watchdog_s=1")}
        assert _watched("mock:?seed=0") is not None
    assert of == {"mock:?fault=none": "heli3dof run steps", "mock:?seed=0&watchdog_s=1": None}


def _watched(url: str) -> str | None:
    doing = heli3dof("monitor", "--device", url, "--seconds", "0", "--json").document["doing"]
    assert doing is None or isinstance(doing, str)
    return doing


def test_the_monitor_shows_currents_with_the_voltages() -> None:
    view = MonitorState()
    reading = {f"{axis}_deg": 1.0 for axis in AXES} | {"flags": ["enabled"]}
    view.add(reading | {"v_front_V": 7.0, "i_front_A": 0.5, "v_back_V": 7.1, "i_back_A": None})
    assert view.line().endswith("front  +7.00 V, +0.50 A  back  +7.10 V  enabled")


def test_the_monitor_shows_angles_rates_and_the_range_seen_in_a_terminal() -> None:
    view = MonitorState()
    for k, angle in enumerate((0.0, -2.0, 1.0)):
        view.add({f"{axis}_deg": angle for axis in AXES} | {"flags": [], "device_time_s": 0.5 * k})
    console = Console(width=80, height=24, file=Utf8(), _environ={})
    console.print(view.screen(console))
    first = console.file.getvalue().splitlines()[0]  # type: ignore[attr-defined]
    assert first == "roll     +1.00°      +6.0 °/s   seen −2.00 to +1.00°"


def test_monitor_ends_with_its_session(fake: FakeDriver) -> None:
    code = (
        "import time; from heli3dof.rig.session.server import Session\n"
        "reads = []\n"
        "with Session('fake://1', doing='x') as session:\n"
        "    session.state = lambda: reads.append(1) or {}\n"
        "    print('held', flush=True)\n"
        "    while not reads: time.sleep(0.01)\n"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as p:
        assert p.stdout is not None
        p.stdout.readline()
        start = time.monotonic()
        result = heli3dof("monitor", "--device", "fake://1", "--seconds", "600")
    assert result.code == 0
    assert "The session has ended" in result.err
    assert time.monotonic() - start < END_S
    assert running("fake://1") == []


def test_monitor_of_a_rig_that_stops_answering_exits_with_3(
    fake: FakeDriver,
) -> None:
    fake.silent_after = 2
    result = heli3dof("monitor", "--seconds", "5", "--json")
    assert result.code == 3
    assert result.document["error"] == "The rig does not answer."


def test_monitor_prints_its_document_after_ctrl_c() -> None:
    run = [sys.executable, "-m", "heli3dof", "monitor", "--device", "mock:", "--json"]
    with subprocess.Popen(run, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as p:
        assert p.stderr is not None
        while "pitch" not in p.stderr.readline():
            pass
        p.send_signal(signal.SIGINT)
        out, _ = p.communicate(timeout=END_S)
    assert p.returncode == 130
    assert json.loads(out)["readings"] >= 1
