"""A stop from another terminal ends a flight in any phase, and is recorded."""

from __future__ import annotations

import threading

import pytest

from heli3dof.errors import SafetyTrip
from heli3dof.experiment.fly import Flight, fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.recording.row import RAMP_DOWN
from heli3dof.rig.interface import Command, Flags, Identity, Sample
from heli3dof.rig.session.client import Request, running
from heli3dof.rig.session.server import Session
from tests.rig.fakes import FakeDriver, FakeRig, only_drivers

PERIODS = 50
LEVEL = (313, 0, 0)
ON_THE_TABLE = (0, 0, 0)


class StoppedRig(FakeRig):
    """Another terminal requests a stop at command number ``stop_at``."""

    def __init__(self, driver: StoppedDriver) -> None:
        super().__init__(driver)
        self.commands: list[Command] = []

    def exchange(self, command: Command, due_s: float) -> Sample:
        self.commands.append(command)
        if len(self.commands) == self.driver.stop_at:
            request_stop()
        return super().exchange(command, due_s)


class StoppedDriver(FakeDriver):
    """Opens a `StoppedRig`."""

    stop_at: int | None = None

    def open(self, url: object, profile: object) -> FakeRig:
        self.rigs.append(StoppedRig(self))
        return self.rigs[-1]


heard = threading.Event()


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch) -> StoppedDriver:
    request_estop = Session.request_estop

    def asked(self: Session, reason: str) -> None:
        request_estop(self, reason)
        heard.set()

    heard.clear()
    monkeypatch.setattr(Session, "request_estop", asked)
    driver = StoppedDriver(counts=LEVEL)
    only_drivers(monkeypatch, fake=driver)
    return driver


def request_stop(identity: Identity | None = None) -> None:
    (session,) = running("fake://1")
    Request(session, {"do": "estop", "reason": "smoke"})
    assert heard.wait(60), "the session's thread did not get the request"


def flown(**keys: object) -> Flight:
    plan = step_plan((0.0, None, None), settle_s=0, duration_s=PERIODS * 2e-3)
    return fly_plan(plan, device="fake://1", **keys)


def is_tripped(flight: Flight) -> bool:
    detail = flight.outcome.detail
    with pytest.raises(SafetyTrip, match="smoke"):
        flight.raise_if_cut_short()
    return flight.outcome.ending == "tripped" and detail == "emergency stop on request: smoke"


def test_without_a_stop_the_plan_is_flown_to_its_end(driver):
    driver.counts = ON_THE_TABLE  # in the air constant counts would be a frozen encoder
    flight = flown()
    assert flight.outcome.ending == "completed"
    assert driver.rigs[0].stopped == []


def test_a_stop_before_arming_prevents_it(driver):
    with pytest.raises(SafetyTrip, match="smoke; it was not armed"):
        flown(opened=request_stop)
    assert driver.rigs[0].armed == 0
    assert "smoke" in driver.rigs[0].stopped


def test_after_a_stop_in_flight_no_volts_are_sent(driver):
    driver.stop_at = 20
    flight = flown()
    assert is_tripped(flight)
    after = driver.rigs[0].commands[20:]
    assert after
    assert all((c.v_front, c.v_back) == (0.0, 0.0) for c in after)
    assert flight.recording.meta["outcome"] == "tripped"
    stopped = flight.recording.channels["flags"].astype(int) & Flags.ESTOP != 0
    assert stopped[-1]
    assert not flight.recording.voltage[stopped].any()
    assert not flight.recording.channels["v_front_sent_V"][stopped].any()


def test_a_stop_in_the_ramp_ends_the_ramp(driver):
    driver.stop_at = PERIODS + 10
    flight = flown()
    assert is_tripped(flight)
    assert not flight.outcome.landed
    assert driver.rigs[0].stopped[0] == "smoke"
    assert flight.recording.channels["phase"][-1] == RAMP_DOWN
    after = driver.rigs[0].commands[PERIODS + 10 :]
    assert all((c.v_front, c.v_back) == (0.0, 0.0) for c in after)
