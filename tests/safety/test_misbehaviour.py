"""Any misbehaviour of a device: no crash, no internal error, motors at zero. See the bench."""

from __future__ import annotations

import random

import pytest
from heli3dof_drivers.link.errors import not_arming
from heli3dof_drivers.link.frames import Cause, Code

from tests.safety import misbehaviour
from tests.safety.misbehaviour import (
    EVENTS,
    FALSE_FRAMES,
    LINE_FAULTS,
    Fault,
    FaultyLine,
    emulated,
    firmware,
)

SEEDS = range(2000, 2012)
"""Other seeds than the bench's"""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_sequence_leaves_no_crash_and_the_motors_at_zero(seed: int) -> None:
    result = emulated(seed)
    assert not result.wrong, result


@pytest.mark.parametrize("kind", sorted({*LINE_FAULTS, *FALSE_FRAMES, *EVENTS}))
def test_each_fault_alone(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    at_s = 0.0 if kind.startswith(("ack", "identity", "report")) else 0.6
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [Fault(kind, at_s, 100.0)])
    result = emulated(1)
    assert not result.wrong, result


@pytest.mark.realtime
@pytest.mark.parametrize("seed", [2000, 2001, 2002])
def test_the_firmware_in_real_time(seed: int) -> None:
    result = firmware(seed)
    assert not result.wrong, result


def test_motors_not_at_zero_are_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    amplifier = "heli3dof_drivers.emulator.amplifier.Amplifier"
    monkeypatch.setattr(f"{amplifier}.output_uV", lambda self, now_us: (1, 0))
    assert any("motors not at zero" in w for w in emulated(1).wrong)


def test_a_crash_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    monkeypatch.setattr(misbehaviour, "summary", lambda recording: 1 / 0)
    assert any("ZeroDivisionError" in w for w in emulated(1).wrong)


def test_a_fault_of_ours_is_detected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    monkeypatch.setattr("heli3dof.experiment.control_loop.loop.Envelope.check", lambda *a: 1 / 0)
    assert any("an internal error" in w for w in emulated(1).wrong)


def test_without_faults_the_flight_completes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    result = emulated(1)
    assert (result.ending, result.wrong) == ("completed", [])


def test_the_line_changes_frames_only_during_a_fault() -> None:
    line = FaultyLine(random.Random(1), [Fault("is silent", 1e6, 1.0)], 1)
    assert line._to_host(b"\x01\x02\0") == b"\x01\x02\0"


def test_the_advice_for_a_held_button_is_to_release_it() -> None:
    error = not_arming("rig", Code.FAULT, Cause.BUTTON, 2000, 100_000)
    assert "its button is pressed" in error.what
    assert error.fix.startswith("release the button")
    assert "button" not in str(not_arming("rig", Code.FAULT, Cause.STALL, 2000, 100_000))


def test_the_message_names_a_code_that_the_protocol_does_not_have() -> None:
    assert "code 127" in not_arming("rig", 127, 0, 2000, 100_000).what
    assert "code" not in not_arming("rig", Code.STALE_TICKET, 0, 2000, 100_000).what
