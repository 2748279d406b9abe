"""An open rig executes a stop in every call, and its counts are zero at rest."""

from __future__ import annotations

import doctest
import inspect
import math
import os
from dataclasses import replace

import pytest

from heli3dof.errors import DeviceError, SafetyTrip
from heli3dof.rig.calibration import RestCounts
from heli3dof.rig.interface import Command, Flags
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.open_exclusive import open_rig
from heli3dof.rig.session.server import Session
from heli3dof.rig.session.stoppable_rig import StoppableRig
from tests.rig.fakes import IDENTITY, FakeDriver, FakeRig, only_drivers


@pytest.fixture
def rig():
    with Session("fake://1") as session:
        yield StoppableRig(FakeRig(FakeDriver(counts=(10, 20, 30))), session)


def test_without_a_stop_commands_pass_unchanged(rig):
    rig.arm()
    assert rig.exchange(Command(1, 3.0, 4.0), 0.0).v_applied == (3.0, 4.0)
    assert rig.inner.stopped == []


def test_an_open_rig_never_gets_more_than_the_profiles_voltage(monkeypatch):
    only_drivers(monkeypatch, fake=FakeDriver())
    profile = default_profile()
    limit = profile.motor.v_max
    with open_rig("fake://1", profile) as rig:
        rig.arm()
        assert rig.exchange(Command(1, 100.0, -math.inf), 0.0).v_applied == (limit, -limit)
        assert rig.exchange(Command(2, limit, -limit), 0.0).v_applied == (limit, -limit)
        front, back = rig.exchange(Command(3, math.nan, 100.0), 0.0).v_applied
    assert math.isnan(front)  # the device stops at it: a limit of it would be a voltage
    assert back == limit


@pytest.mark.parametrize("broken", ["options", "open", "identity", "close"])
def test_a_bug_in_a_driver_names_its_package(monkeypatch, broken):
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    if broken == "identity":
        driver.identity = None
    else:
        owner = FakeRig if broken == "close" else driver
        monkeypatch.setattr(owner, broken, None)
    with (
        pytest.raises(DeviceError, match=r"class Fake.* failed: TypeError") as caught,
        open_rig("fake://1", default_profile()),
    ):
        pass
    assert caught.value.cause.startswith("a bug in its package, tests")


def test_the_example_of_open_rig_runs():
    text = inspect.getdoc(open_rig)
    example = doctest.DocTestParser().get_doctest(text, {}, "open_rig", None, 0)
    assert len(example.examples) == 4
    assert doctest.DocTestRunner().run(example).failed == 0


def test_a_stop_is_executed_once_and_confirmed_before_the_next_command(rig):
    rig.arm()
    rig.session.request_estop("smoke")
    assert rig.session.stopped is None
    sample = rig.exchange(Command(1, 3.0, 4.0), 0.0)
    assert sample.v_applied == (0.0, 0.0)
    assert sample.flags & Flags.ESTOP
    assert rig.session.stopped
    rig.exchange(Command(2, 3.0, 4.0), 0.0)
    assert rig.inner.stopped == ["smoke"]


def test_a_stop_before_arming_forbids_arming(rig):
    rig.session.request_estop("smoke")
    for _ in range(2):
        with pytest.raises(SafetyTrip, match="smoke"):
            rig.arm()
    assert rig.inner.armed == 0
    assert rig.inner.stopped == ["smoke"]


def test_a_stop_without_the_devices_acknowledgement_is_not_confirmed(rig):
    def deaf(reason: str) -> None:
        raise DeviceError("not acknowledged")

    rig.inner.estop = deaf
    rig.session.request_estop("smoke")
    with pytest.raises(DeviceError):
        rig.exchange(Command(1, 3.0, 4.0), 0.0)
    assert rig.session.stopped is None


def test_reading_executes_a_stop(rig):
    rig.session.request_estop("smoke")
    rig.read()
    assert rig.session.stopped


def test_counts_are_zero_at_the_rest_angles(rig):
    rig.rest = RestCounts((1, 2, 3), "zero")
    assert rig.arm().counts == rig.read().counts == (9, 18, 27)
    sample = rig.exchange(Command(1, 3.0, 4.0), 0.0)
    assert sample.counts == (9, 18, 27)
    assert (sample.sequence, sample.v_applied) == (1, (3.0, 4.0))


def test_an_open_rig_is_locked(monkeypatch):
    only_drivers(monkeypatch, fake=FakeDriver())
    with (
        open_rig("fake://1", default_profile()),
        pytest.raises(DeviceError, match="busy"),
        open_rig("fake://1", default_profile()),
    ):
        pass


def test_a_rig_cannot_be_opened_through_two_ports(monkeypatch):
    pipe, port = FakeDriver(), FakeDriver(scheme="port")
    only_drivers(monkeypatch, pipe=pipe, port=port)
    for _ in range(2):
        with open_rig("pipe://1", default_profile(), doing="heli3dof run rich"):
            with (
                pytest.raises(DeviceError) as caught,
                open_rig("port:///dev/null", default_profile()),
            ):
                pass
            assert caught.value.exit_code == 3
            assert f"pid {os.getpid()} runs `heli3dof run rich`" in caught.value.what
            assert "through pipe://1" in caught.value.what
    assert port.closed == 2
    with open_rig("port:///dev/null", default_profile()):
        pass


def test_rigs_with_one_serial_number_differ_by_their_boot_number(monkeypatch):
    one, two = FakeDriver(), FakeDriver(identity=replace(IDENTITY, boot=8))
    only_drivers(monkeypatch, one=one, two=two)
    with open_rig("one://1", default_profile()), open_rig("two://1", default_profile()):
        pass


def test_a_rig_is_closed_and_unlocked_after_an_error(monkeypatch):
    driver = FakeDriver()
    only_drivers(monkeypatch, fake=driver)
    with pytest.raises(ZeroDivisionError), open_rig("fake://1", default_profile()):
        raise ZeroDivisionError
    assert driver.closed == 1
    with open_rig("fake://1", default_profile()):
        pass


def test_a_rig_that_does_not_open_is_unlocked(monkeypatch):
    only_drivers(monkeypatch)
    for _ in range(2):
        with pytest.raises(Exception, match="no driver"), open_rig("fake://1", default_profile()):
            pass


def test_the_devices_cause_is_passed_on(rig):
    assert rig.device_cause is None
    rig.inner.device_cause = "BUTTON"
    assert rig.device_cause == "BUTTON"
    rig.inner.device_cause = 4
    assert rig.device_cause is None


@pytest.mark.parametrize("serial", ["", "  "])
def test_a_device_without_a_serial_number_is_refused(serial, monkeypatch):
    driver = FakeDriver(identity=replace(IDENTITY, serial=serial))
    only_drivers(monkeypatch, fake=driver)
    with (
        pytest.raises(DeviceError, match="no serial number"),
        open_rig("fake://1", default_profile()),
    ):
        pass
    assert driver.closed == 1
