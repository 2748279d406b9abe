"""The rows of docs/reference/safety.md that need a process and a line, with an emulated device.

The device is behind a pseudo-terminal; its amplifier's output is measured. Its watchdog is long
enough for a busy machine, and the bounds follow from it.
"""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.recording import Recording
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.stop_stamp import start_command
from tests.cli.running import heli3dof
from tests.profiles import END_S, PATIENT, STALL_S, profile, write_profile
from tests.safety.bench import Bench, Over
from tests.safety.table import BY_NAME

pytestmark = pytest.mark.realtime
PROFILE = default_profile()
BUSY_S = STALL_S + 0.1
"""s by which a busy machine may delay the emulated device's thread, and the test"""


class Opened(Protocol):
    """A device: `Bench`, or the firmware."""

    @property
    def url(self) -> str: ...

    def wait_until_flying(self, over: Over) -> None: ...


@dataclass
class Flight:
    process: subprocess.Popen[str]
    path: Path

    def end(self) -> tuple[int, str]:
        """Exit code and standard error."""
        _, err = self.process.communicate(timeout=END_S)
        return self.process.returncode, err

    @property
    def recording(self) -> Recording:
        return read_recording(self.path)


@contextmanager
def flying(
    bench: Opened, folder: Path, *, duration_s: float = 20, **limits: float
) -> Iterator[Flight]:
    """``heli3dof run-step`` in a process of its own, in flight."""
    path = folder / "flight.mcap"
    command = [
        sys.executable, "-m", "heli3dof", "run-step", "--roll", "3", "--settle", "1",
        "--duration", str(duration_s), "--device", bench.url, "-o", str(path),
        "--profile", str(write_profile(folder / "rig.toml", **(PATIENT | limits))),
    ]  # fmt: skip
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            try:
                bench.wait_until_flying(process.poll)
            except AssertionError as problem:
                process.kill()
                raise AssertionError(process.communicate()[1]) from problem
            yield Flight(process, path)
        finally:
            process.send_signal(signal.SIGCONT)
            process.kill()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with Bench() as bench:
        yield bench


def starts_clean(bench: Opened) -> None:
    """Assert that the next flight arms and completes."""
    start_command()
    plan = step_plan((None, None, None), settle_s=0.2, duration_s=0.1)
    patient = profile(**PATIENT, landing_s=0.1)
    outcome = fly_plan(plan, device=bench.url, profile=patient).outcome
    assert outcome.ending == "completed", outcome.detail


def within(name: str, bench: Bench, since_s: float) -> float:
    """s until zero volts: the row's bound, and the machine's stalls."""
    allowed_s = BY_NAME[name].zero.seconds(PROFILE, bench.watchdog_s) + BUSY_S
    return allowed_s + bench.away_s(since_s)


def ended(name: str, flight: Flight) -> None:
    """Assert that exit code and recording are the row's."""
    row = BY_NAME[name]
    code, err = flight.end()
    assert code == row.exit_code, err
    meta = flight.recording.meta
    assert (meta["outcome"], row.detail in meta["outcome_details"]["detail"]) == (
        row.ending,
        True,
    ), meta["outcome_details"]["detail"]


def test_kill_9(bench: Bench, tmp_path: Path) -> None:
    with flying(bench, tmp_path) as flight:
        killed_s = time.monotonic()
        flight.process.kill()
        code, _ = flight.end()
        bench.wait_until_zero()
    assert code == BY_NAME["kill_9"].exit_code
    assert bench.last_command_s < killed_s + BUSY_S
    assert killed_s < bench.zero_s <= killed_s + within("kill_9", bench, killed_s)
    assert heli3dof("recover", flight.path).code == 0
    saved = read_recording(flight.path.with_name("flight.recovered.mcap"))
    assert saved.meta["outcome"] == "recovered"
    starts_clean(bench)


def test_stopped_process(bench: Bench, tmp_path: Path) -> None:
    with flying(bench, tmp_path) as flight:
        stopped_s = time.monotonic()
        flight.process.send_signal(signal.SIGSTOP)
        bench.wait_until_zero()
        assert stopped_s < bench.zero_s <= stopped_s + within("stopped_process", bench, stopped_s)
        flight.process.send_signal(signal.SIGCONT)
        ended("stopped_process", flight)
    assert stopped_s < bench.zero_s <= stopped_s + within("stopped_process", bench, stopped_s)
    starts_clean(bench)


def test_estop_from_a_second_terminal(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("heli3dof.rig.session.estop.PATIENCE_S", 10.0)  # the machine may be busy
    with flying(bench, tmp_path) as flight:
        requested_s = time.monotonic()
        assert heli3dof("estop", "--device", bench.url).code == 0
        ended("estop_from_a_second_terminal", flight)
    late_s = within("estop_from_a_second_terminal", bench, requested_s)
    assert requested_s < bench.zero_s <= requested_s + late_s
    assert [o for o in bench.log if o.flags & Flags.ESTOP], "stopped, not only at zero volts"
    starts_clean(bench)


def test_cable_out(bench: Bench, tmp_path: Path) -> None:
    with flying(bench, tmp_path) as flight:
        pulled_s = bench.pull()
        ended("cable_out", flight)
        bench.wait_until_zero()
    assert pulled_s < bench.zero_s <= pulled_s + within("cable_out", bench, pulled_s)
    bench.plug()
    starts_clean(bench)


def test_cable_out_at_the_rigs_end(bench: Bench, tmp_path: Path) -> None:
    """The port stays, without bytes in either direction."""
    with flying(bench, tmp_path) as flight:
        bench.deaf = bench.mute = True
        cut_s = time.monotonic()
        code, err = flight.end()
        assert code == BY_NAME["cable_out"].exit_code
        assert "gone silent" in err
        assert flight.recording.meta["outcome"] == "device"
        bench.wait_until_zero()
    assert cut_s < bench.zero_s <= cut_s + within("cable_out", bench, cut_s)
    bench.deaf = bench.mute = False
    starts_clean(bench)


def test_device_reset(bench: Bench, tmp_path: Path) -> None:
    with flying(bench, tmp_path) as flight:
        reset_s = bench.reset()
        ended("device_reset", flight)
    assert reset_s < bench.zero_s <= reset_s + within("device_reset", bench, reset_s)
    starts_clean(bench)


@pytest.mark.parametrize("lost", ["commands", "samples"])
def test_lost_frames(lost: str, tmp_path: Path) -> None:
    # The host must end the flight before the device's watchdog does. The loss is long enough to
    # count as one even if the host stalls meanwhile.
    with Bench(watchdog_s=0.9) as bench:
        with flying(bench, tmp_path, lost_max_s=STALL_S + 0.05) as flight:
            setattr(bench, {"commands": "deaf", "samples": "mute"}[lost], True)
            time.sleep(2 * STALL_S + 0.1)
            bench.deaf = bench.mute = False
            restored_s = time.monotonic()
            ended("lost_frames", flight)
        assert restored_s < bench.zero_s <= restored_s + within("lost_frames", bench, restored_s)
        starts_clean(bench)


def test_second_process(bench: Bench, tmp_path: Path) -> None:
    words = ("run-step", "--roll", "5", "--device", bench.url)
    assert heli3dof(*words, "--dry-run").code == 0, "imports before the flight"
    with flying(bench, tmp_path, duration_s=2) as flight:
        second = heli3dof(*words)
        assert second.code == BY_NAME["second_process"].exit_code
        assert f"pid {flight.process.pid}" in second.err
        code, err = flight.end()
    assert (code, flight.recording.meta["outcome"]) == (0, "completed"), err
    starts_clean(bench)
