"""The rows of docs/reference/safety.md in one process: the device's output, by period."""

from __future__ import annotations

import errno
import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from heli3dof.errors import NoSpace
from heli3dof.experiment.safety_monitors import host_suspend
from heli3dof.model.control.controller import Controller
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.mcap_writer import McapFile
from heli3dof.recording.row import Row
from heli3dof.rig.profile import default_profile
from tests.profiles import write_profile
from tests.safety.aboard import Aboard

MOCK = "mock:?speed=max&seed=1&start=level"
EVENT_S = 1.0
IN_FLIGHT_AND_IN_RAMP = (EVENT_S, 5.0)
"""s; the ramp at the plan's end begins at 4 s and takes 3 s"""


@pytest.fixture
def aboard(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Aboard:
    return Aboard(monkeypatch, tmp_path)


def send(number: signal.Signals) -> Callable[[], None]:
    return lambda: os.kill(os.getpid(), number)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_ctrl_c(aboard: Aboard, at_s: float) -> None:
    aboard.at(at_s, send(signal.SIGINT))
    aboard.shows("ctrl_c", aboard.flown(MOCK), at_s)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_second_ctrl_c(aboard: Aboard, at_s: float) -> None:
    aboard.at(at_s, send(signal.SIGINT))
    aboard.at(at_s + 0.1, send(signal.SIGINT))
    aboard.shows("second_ctrl_c", aboard.flown(MOCK), at_s + 0.1)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_sigterm(aboard: Aboard, at_s: float) -> None:
    aboard.at(at_s, send(signal.SIGTERM))
    aboard.shows("sigterm", aboard.flown(MOCK), at_s)


def test_terminal_closed(aboard: Aboard) -> None:
    before = signal.signal(signal.SIGHUP, signal.default_int_handler)
    try:
        aboard.at(EVENT_S, send(signal.SIGHUP))
        aboard.shows("terminal_closed", aboard.flown(MOCK), EVENT_S)
    finally:
        signal.signal(signal.SIGHUP, before)


def controller(
    aboard: Aboard, monkeypatch: pytest.MonkeyPatch, instead: Callable[[], object]
) -> None:
    """From `EVENT_S` on the controller does this."""
    real = Controller.step

    def step(self: Controller, *a: object) -> object:
        if aboard.t >= EVENT_S - 1e-9:
            result = instead()
            if result is not None:
                return result
        return real(self, *a)  # type: ignore[arg-type]

    monkeypatch.setattr(Controller, "step", step)


def test_exception_in_the_controller(aboard: Aboard, monkeypatch: pytest.MonkeyPatch) -> None:
    controller(aboard, monkeypatch, lambda: 1 / 0)
    aboard.shows("exception_in_the_controller", aboard.flown(MOCK), EVENT_S)


def test_nan_from_the_controller(aboard: Aboard, monkeypatch: pytest.MonkeyPatch) -> None:
    nan = (float("nan"), float("nan"))
    controller(aboard, monkeypatch, lambda: (nan, nan))
    aboard.shows("nan_from_the_controller", aboard.flown(MOCK), EVENT_S)


@pytest.mark.parametrize("axis", ["roll", "pitch", "yaw"])
@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_encoder_jump(aboard: Aboard, axis: str, at_s: float) -> None:
    done = aboard.flown(f"{MOCK}&fault=jump.{axis}@{at_s}:-40")
    aboard.shows("encoder_jump", done, at_s - default_profile().dt)
    assert f"the {axis} encoder" in done.err


@pytest.mark.parametrize(("axis", "plan"), [("roll", "steps"), ("pitch", "steps"), ("yaw", "rich")])
def test_frozen_encoder(aboard: Aboard, axis: str, plan: str) -> None:
    frozen = f"mock:?speed=max&seed=1&fault=frozen.{axis}@0.01"
    done = aboard.flown_plan(plan, frozen)
    aboard.shows("frozen_encoder", done, aboard.ramp_s)
    assert f"the {axis} encoder" in done.err


def test_envelope_trip(aboard: Aboard, tmp_path: Path) -> None:
    done = aboard.flown(MOCK, "--profile", write_profile(tmp_path / "rig.toml", roll_max_deg=3.2))
    aboard.shows("envelope_trip", done, aboard.ramp_s)


def test_saturated_for_too_long(aboard: Aboard, tmp_path: Path) -> None:
    weak = write_profile(tmp_path / "rig.toml", v_max=7.6, saturated_max_s=0.2)
    done = aboard.flown(MOCK, "--profile", weak)
    aboard.shows("saturated_for_too_long", done, aboard.ramp_s)


def test_late_ticks(aboard: Aboard, monkeypatch: pytest.MonkeyPatch) -> None:
    controller(aboard, monkeypatch, lambda: time.sleep(0.015))
    done = aboard.flown("mock:?seed=1&start=level&watchdog_s=5")
    # A busy machine is late in the ramp too.
    slack_s = aboard.recording.meta["outcome_details"]["worst_lateness_s"]
    aboard.shows("late_ticks", done, aboard.ramp_s, slack_s=slack_s)
    assert aboard.ramp_s < EVENT_S + 1.0 + slack_s


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_laptop_suspend(aboard: Aboard, monkeypatch: pytest.MonkeyPatch, at_s: float) -> None:
    real = host_suspend.ahead_s
    slept = [0.0]
    monkeypatch.setattr(host_suspend, "ahead_s", lambda: real() + slept[0])
    aboard.at(at_s, lambda: slept.append(slept.pop() + 600.0))
    done = aboard.flown(MOCK)
    aboard.shows("laptop_suspend", done, at_s)
    assert aboard.zero_s <= at_s + 2 * default_profile().dt + 1e-9, "no ramp after waking"


def device_stop(aboard: Aboard, name: str, fault: str, at_s: float) -> None:
    done = aboard.flown(f"{MOCK}&fault={fault}@{at_s}")
    # The fault happens at the end of the period that reaches that time.
    aboard.shows(name, done, at_s - default_profile().dt, slack_s=default_profile().dt)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_stalled_motor(aboard: Aboard, at_s: float) -> None:
    device_stop(aboard, "stalled_motor", "stall", at_s)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
@pytest.mark.parametrize("fault", ["overcurrent", "overtemperature"])
def test_amplifier_fault(aboard: Aboard, fault: str, at_s: float) -> None:
    device_stop(aboard, "amplifier_fault", fault, at_s)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_button(aboard: Aboard, at_s: float) -> None:
    device_stop(aboard, "button", "button", at_s)


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_amplifier_output(aboard: Aboard, at_s: float) -> None:
    aboard.at(at_s, lambda: aboard.device.disable())
    done = aboard.flown(MOCK)
    aboard.shows("amplifier_output", done, at_s)
    assert "does not report ENABLED any more" in done.err


def test_an_amplifier_that_holds_its_voltages_is_stopped(aboard: Aboard) -> None:
    def hold() -> None:
        device, command = aboard.device, aboard.device.command
        device.command = lambda number, *volts: command(
            number, *(device.v if any(device.v) else volts)
        )

    aboard.at(EVENT_S, hold)
    done = aboard.flown(MOCK, roll="20")
    detection_s = aboard.zero_s - 2 * default_profile().dt
    aboard.shows("amplifier_output", done, detection_s)
    assert "has not followed the commands for 51 samples" in done.err


@pytest.mark.parametrize("at_s", IN_FLIGHT_AND_IN_RAMP)
def test_full_disk(aboard: Aboard, monkeypatch: pytest.MonkeyPatch, at_s: float) -> None:
    real = McapFile.write_chunk

    def write_chunk(self: McapFile, data: bytes) -> None:
        if aboard.t >= at_s:
            raise OSError(errno.ENOSPC, "No space left on device")
        real(self, data)

    monkeypatch.setattr(McapFile, "write_chunk", write_chunk)
    append, reported_s = RecordingWriter.append, []

    def reporting(self: RecordingWriter, row: Row) -> None:
        try:
            append(self, row)
        except NoSpace:
            reported_s.append(aboard.t)
            raise

    monkeypatch.setattr(RecordingWriter, "append", reporting)
    # Five times real time: the recorder must run before the plan is over.
    done = aboard.flown(MOCK.replace("max", "5"))
    assert "df -h" in done.err
    assert reported_s[0] < at_s + 2.0
    aboard.shows("full_disk", done, reported_s[0])
