"""Ten thousand corrupted frames: no wrong command, no wrong sample, synchronised again at once.

``make bench TOPIC=link`` does the same with a million and more.
"""

from __future__ import annotations

import pytest
from heli3dof_drivers.emulator.amplifier import Amplifier
from heli3dof_drivers.link import frames, sample_validation

from tests.drivers.link.faults import KINDS, Trial


def test_no_line_error_becomes_a_command_or_a_sample():
    tally = Trial(seed=1).run(faults=10_000)
    assert set(tally.harmed) == set(KINDS)
    assert min(tally.harmed.values()) > 1000
    assert (tally.wrong_commands, tally.wrong_armings, tally.wrong_samples) == (0, 0, 0)
    assert tally.unsynchronised == 0
    # The line still transmitted most frames.
    assert tally.resyncs > 2000
    assert tally.commands > 2000
    assert tally.samples > 1000
    assert tally.armings > 20


def test_a_line_without_errors_loses_nothing():
    trial = Trial(seed=2, share=0.0)
    for _ in range(1000):
        trial.step()
    tally = trial.tally
    assert (tally.faults, tally.wrong) == (0, 0)
    # Only commands after a DISARM or an ESTOP in the same step are refused.
    assert 960 < tally.commands < 1000
    assert tally.samples > 1000


def test_the_trial_fails_without_the_frame_check(monkeypatch: pytest.MonkeyPatch):
    """Without the check, wrong voltages are applied."""
    monkeypatch.setattr(frames, "check", lambda data: data[-4:])
    original = frames.parse

    def careless(piece: bytes):
        try:
            data = frames.decode(piece)
        except frames.DecodeError:
            return None
        kind = frames._KINDS.get(data[1]) if len(data) > 1 else None
        if kind is None or len(data) != frames._LENGTHS[data[1]]:
            return original(piece)
        return kind(
            frames._HEADER.unpack_from(data)[2],
            *kind.BODY.unpack_from(data, frames._HEADER.size),
        )

    monkeypatch.setattr(frames, "parse", careless)
    monkeypatch.setattr("heli3dof_drivers.emulator.endpoint.parse", careless)
    assert Trial(seed=1).run(faults=2000).wrong_commands > 0


def test_the_trial_fails_for_a_host_that_accepts_old_samples(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sample_validation, "_HALF", 2**33)
    assert Trial(seed=1).run(faults=2000).wrong_samples > 0


def test_the_trial_fails_for_a_device_that_accepts_old_commands(monkeypatch: pytest.MonkeyPatch):
    command = Amplifier.command

    def careless(self: Amplifier, now_us: int, number: int, front_uV: int, back_uV: int) -> bool:
        self.last = number - 1
        return command(self, now_us, number, front_uV, back_uV)

    monkeypatch.setattr(Amplifier, "command", careless)
    assert Trial(seed=1).run(faults=2000).wrong_commands > 0
