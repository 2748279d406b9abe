"""The checks of ``doctor --arm``."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from heli3dof_drivers.link.request_reply import LinkStatistics

from heli3dof.rig.doctor import armed
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Check, Command, Flags, Sample
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.server import Session
from heli3dof.rig.session.stoppable_rig import StoppableRig
from tests.rig.fakes import IDENTITY, FakeDriver, FakeRig

PROFILE = default_profile()


@pytest.fixture(autouse=True)
def short(monkeypatch, own_clock):
    monkeypatch.setattr(armed, "SECONDS", 0.05)
    monkeypatch.setattr(armed, "LONGEST_RAMP_S", 0.05)


def results_of(rig) -> dict[str, Check]:
    with Session("fake://1", private=True) as session:
        checks = armed.checks(StoppableRig(rig, session), PROFILE)
        return {check.what: check for check in checks}


class Commanded(FakeRig):
    """Keeps its commands; it has no watchdog, and arming clears a stop."""

    def __init__(self, driver: FakeDriver | None = None) -> None:
        super().__init__(driver or FakeDriver(identity=replace(IDENTITY, watchdog_s=0.01)))
        self.commands: list[Command] = []
        self.lost_every = 0

    def arm(self) -> Sample:
        self.stopped.clear()
        return super().arm()

    def exchange(self, command: Command, due_s: float) -> Sample:
        self.commands.append(command)
        if self.lost_every and len(self.commands) % self.lost_every == 0:
            self.k += 1
        return super().exchange(command, due_s)


def test_the_emulated_rig_passes():
    rig = open_driver("mock:?watchdog_s=0.3&noise=0", PROFILE)
    good = {c.what: c.good for c in results_of(rig).values()}
    assert good["watchdog at work"] is True
    assert good["emergency stop at work"] is True


def test_a_device_without_a_watchdog_fails():
    check = results_of(Commanded())["watchdog at work"]
    assert check.good is False
    assert "DID NOT EXPIRE" in check.found
    assert "do not fly" in check.fix


def test_every_command_is_zero_volts():
    rig = Commanded()
    results_of(rig)
    assert rig.commands
    assert all((c.v_front, c.v_back) == (0.0, 0.0) for c in rig.commands)


def test_the_rig_is_stopped_at_the_end():
    rig = Commanded()
    results_of(rig)
    assert rig.stopped == ["heli3dof doctor is done"]


def test_the_devices_clock_reveals_lost_samples():
    rig = Commanded()
    rig.lost_every = 10
    check = results_of(rig)["traffic of the loop"]
    assert check.good is False
    rig = Commanded()
    assert results_of(rig)["traffic of the loop"].good is True


@pytest.mark.parametrize(
    ("counter", "words", "fix"),
    [
        ("lost", "lost on the line", "cable"),
        ("device_skipped", "skipped by the device", "lower loop.rate_hz"),
        ("samples_stale", "read too late by this computer", "wake-up"),
    ],
)
def test_a_link_with_counters_names_where_samples_were_lost(counter: str, words: str, fix: str):
    class Counting(Commanded):
        def __init__(self) -> None:
            super().__init__()
            self.statistics = LinkStatistics(lost=3, device_skipped=2, samples_stale=1)
            self.lost_every = 10

        def exchange(self, command: Command, due_s: float) -> Sample:
            sample = super().exchange(command, due_s)
            if len(self.commands) % self.lost_every == 0:
                setattr(self.statistics, counter, getattr(self.statistics, counter) + 1)
            return sample

    check = results_of(Counting())["traffic of the loop"]
    assert check.good is False
    assert words in check.found
    assert check.found.count("by the device") + check.found.count("on the line") <= 1
    assert fix in check.fix


def test_a_stop_that_a_command_clears_fails():
    class Forgetful(Commanded):
        def estop(self, reason: str) -> None:
            pass

    check = results_of(Forgetful())["emergency stop at work"]
    assert check.good is False
    assert "did not stay stopped" in check.found


def test_an_output_that_is_not_measured_passes():
    class Unmeasured(Commanded):
        def exchange(self, command: Command, due_s: float) -> Sample:
            return replace(super().exchange(command, due_s), v_applied=(math.nan, math.nan))

    assert "zero volts" not in results_of(Unmeasured())


def test_an_output_other_than_zero_fails():
    class Leaking(Commanded):
        def exchange(self, command: Command, due_s: float) -> Sample:
            return replace(super().exchange(command, due_s), v_applied=(0.4, 0.0))

    check = results_of(Leaking())["zero volts"]
    assert check.good is False
    assert "0.4 and 0 V" in check.found


def test_the_watchdog_of_a_virtual_clock_is_not_checked():
    rig = Commanded(FakeDriver(identity=replace(IDENTITY, timebase="virtual")))
    assert results_of(rig)["watchdog at work"].good is None


def test_a_stop_flag_with_an_enabled_amplifier_fails():
    class Both(Commanded):
        def exchange(self, command: Command, due_s: float) -> Sample:
            sample = super().exchange(command, due_s)
            return replace(sample, flags=sample.flags | Flags.ENABLED)

    assert results_of(Both())["emergency stop at work"].good is False
