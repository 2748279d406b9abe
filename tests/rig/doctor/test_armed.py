"""``doctor --arm`` finds a device without a watchdog before the first volt."""

from __future__ import annotations

from dataclasses import replace

import pytest
from heli3dof_drivers.link.link_statistics import LinkStatistics

from heli3dof.rig.doctor import armed
from heli3dof.rig.drivers import open_rig
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


def looked_at(rig) -> dict[str, Check]:
    held = StoppableRig(rig, Session("fake://1", private=True))
    return {check.what: check for check in armed.checks(held, PROFILE)}


class Commanded(FakeRig):
    """Keeps its commands; nothing ever latches it, and arming ends a stop."""

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
    rig = open_rig("mock:?watchdog_s=0.3&noise=0", PROFILE)
    good = {c.what: c.good for c in looked_at(rig).values()}
    assert good["watchdog at work"] is True
    assert good["emergency stop at work"] is True


def test_a_device_without_a_watchdog_is_found():
    check = looked_at(Commanded())["watchdog at work"]
    assert check.good is False
    assert "DID NOT EXPIRE" in check.found
    assert "do not fly" in check.fix


def test_no_command_is_ever_other_than_zero_volts():
    rig = Commanded()
    looked_at(rig)
    assert rig.commands
    assert all((c.v_front, c.v_back) == (0.0, 0.0) for c in rig.commands)


def test_it_leaves_the_rig_stopped():
    rig = Commanded()
    looked_at(rig)
    assert rig.stopped == ["heli3dof doctor is done"]


def test_lost_samples_are_seen_in_the_devices_time():
    rig = Commanded()
    rig.lost_every = 10
    check = looked_at(rig)["traffic of the loop"]
    assert check.good is False
    rig = Commanded()
    assert looked_at(rig)["traffic of the loop"].good is True


@pytest.mark.parametrize(
    ("why", "said", "fix"),
    [
        ("lost", "lost on the line", "cable"),
        ("device_skipped", "skipped by the device", "lower loop.rate_hz"),
        ("samples_stale", "came too late for this computer", "wake-up"),
    ],
)
def test_where_samples_went_is_told_by_a_link_that_counts_them(why: str, said: str, fix: str):
    class Counting(Commanded):
        def __init__(self) -> None:
            super().__init__()
            self.statistics = LinkStatistics(lost=3, device_skipped=2, samples_stale=1)
            self.lost_every = 10

        def exchange(self, command: Command, due_s: float) -> Sample:
            sample = super().exchange(command, due_s)
            if len(self.commands) % self.lost_every == 0:
                setattr(self.statistics, why, getattr(self.statistics, why) + 1)
            return sample

    check = looked_at(Counting())["traffic of the loop"]
    assert check.good is False
    assert said in check.found
    assert check.found.count("by the device") + check.found.count("on the line") <= 1
    assert fix in check.fix


def test_a_stop_that_a_command_undoes_is_found():
    class Forgetful(Commanded):
        def estop(self, reason: str) -> None:
            pass

    check = looked_at(Forgetful())["emergency stop at work"]
    assert check.good is False
    assert "did not stay stopped" in check.found


def test_an_amplifier_that_puts_out_volts_unasked_is_found():
    class Leaking(Commanded):
        def exchange(self, command: Command, due_s: float) -> Sample:
            return replace(super().exchange(command, due_s), v_applied=(0.4, 0.0))

    check = looked_at(Leaking())["zero volts"]
    assert check.good is False
    assert "0.4 and 0 V" in check.found


def test_a_virtual_clock_is_not_asked_for_its_watchdog():
    rig = Commanded(FakeDriver(identity=replace(IDENTITY, timebase="virtual")))
    assert looked_at(rig)["watchdog at work"].good is None


def test_a_flag_for_the_stop_is_not_enough_while_it_is_enabled():
    class Both(Commanded):
        def exchange(self, command: Command, due_s: float) -> Sample:
            sample = super().exchange(command, due_s)
            return replace(sample, flags=sample.flags | Flags.ENABLED)

    assert looked_at(Both())["emergency stop at work"].good is False
