"""Whatever a device states or does: no crash, no fault of ours, motors at zero. See the bench."""

from __future__ import annotations

import random

import pytest
from heli3dof_drivers.link.errors import not_arming
from heli3dof_drivers.link.frames import Code

from tests.safety import misbehaviour
from tests.safety.misbehaviour import ACTS, HARMS, STATES, Fault, NastyLine, emulated, firmware

SEEDS = range(2000, 2012)
"""Apart from the bench's own"""


@pytest.mark.parametrize("seed", SEEDS)
def test_a_random_sequence_leaves_no_crash_and_the_motors_at_zero(seed: int) -> None:
    found = emulated(seed)
    assert not found.wrong, found


@pytest.mark.parametrize("kind", sorted({*HARMS, *STATES, *ACTS}))
def test_each_fault_alone_from_the_opening_or_from_mid_flight_on(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    at_s = 0.0 if kind.startswith(("ack", "identity", "report")) else 0.6
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [Fault(kind, at_s, 100.0)])
    found = emulated(1)
    assert not found.wrong, found


@pytest.mark.realtime
@pytest.mark.parametrize("seed", [2000, 2001, 2002])
def test_the_firmware_in_real_time(seed: int) -> None:
    found = firmware(seed)
    assert not found.wrong, found


def test_the_judge_sees_motors_that_are_not_at_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    amplifier = "heli3dof_drivers.emulator.amplifier.Amplifier"
    monkeypatch.setattr(f"{amplifier}.output_uV", lambda self, now_us: (1, 0))
    assert any("motors not at zero" in w for w in emulated(1).wrong)


def test_the_judge_sees_a_crash(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    monkeypatch.setattr(misbehaviour, "summary", lambda recording: 1 / 0)
    assert any("ZeroDivisionError" in w for w in emulated(1).wrong)


def test_the_judge_sees_a_fault_of_ours(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    monkeypatch.setattr("heli3dof.experiment.control_loop.loop.Envelope.check", lambda *a: 1 / 0)
    assert any("a fault of ours" in w for w in emulated(1).wrong)


def test_without_faults_the_flight_is_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(misbehaviour, "draw_faults", lambda rng: [])
    found = emulated(1)
    assert (found.ending, found.wrong) == ("completed", [])


def test_the_line_harms_only_while_a_fault_lasts() -> None:
    line = NastyLine(random.Random(1), [Fault("is silent", 1e6, 1.0)], 1)
    assert line._to_host(b"\x01\x02\0") == b"\x01\x02\0"


def test_a_code_that_the_protocol_does_not_have_is_said_to_be_one() -> None:
    assert "code 127" in not_arming("rig", 127, 0, 2000, 100_000).what
    assert "code" not in not_arming("rig", Code.STALE_TICKET, 0, 2000, 100_000).what
