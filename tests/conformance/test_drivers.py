"""What every driver owes the port, on every rig that can be opened without hardware.

A driver that is registered stands either in `WITHOUT_HARDWARE`, with the URLs to open, or in
`NEEDS_HARDWARE`; a new one that stands in neither fails here.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from itertools import pairwise

import pytest

from heli3dof.errors import DeviceError, UsageError
from heli3dof.rig.drivers import load_driver, open_rig, registered
from heli3dof.rig.port import Command, Flags, Rig, Sample
from heli3dof.rig.profile import default_profile
from heli3dof.rig.url import parse_url
from tests.drivers.doors import Door, firmware_door, python_door

PROFILE = default_profile()

WITHOUT_HARDWARE = {
    # A watchdog of 0.3 s: a busy test machine may well be silent for 0.1 s.
    "mock": (
        "mock:?speed=max",
        "mock:?speed=real&watchdog_s=0.3",
        "mock:?speed=50&start=level&seed=3",
    ),
    "serial": (
        "serial://{python}?watchdog_s=0.3",
        "serial://{python}?watchdog_s=0.3&stream=0",
        "serial://{firmware}?watchdog_s=0.3",
        "serial://{firmware}?watchdog_s=0.3&stream=0",
    ),
    "usb": (
        "usb+mock:?watchdog_s=0.3",
        "usb+mock:?watchdog_s=0.3&stream=0&seed=3&start=level",
    ),
}
NEEDS_HARDWARE: set[str] = set()
URLS = [url for urls in WITHOUT_HARDWARE.values() for url in urls]
LIMIT = PROFILE.motor.v_max


class Session:
    """A rig with a host that keeps its deadlines."""

    def __init__(self, rig: Rig) -> None:
        self.rig = rig
        self.sequence = 0
        self.due = 0.0

    def arm(self) -> Sample:
        sample = self.rig.arm()
        self.due = time.monotonic()
        return sample

    def send(self, v_front: float, v_back: float) -> Sample:
        self.sequence += 1
        # Absolute deadlines; those that were missed altogether are skipped.
        self.due += PROFILE.dt * max(1, math.ceil((time.monotonic() - self.due) / PROFILE.dt))
        return self.rig.exchange(Command(self.sequence, v_front, v_back), self.due)

    def hold(self, v_front: float, v_back: float) -> Sample:
        """Send until a sample echoes it: on a busy machine a command may miss its period."""
        for _ in range(20):
            sample = self.send(v_front, v_back)
            if sample.sequence == self.sequence:
                return sample
        raise AssertionError("the rig never carried out what it was sent")


DOORS: dict[str, Callable[[], AbstractContextManager[Door]]] = {
    "python": python_door,
    "firmware": firmware_door,
}
"""Emulated rigs that stand in a process of their own, by the name in their URLs' braces."""


class Doors:
    """Opens the door that a URL names, once, and puts its path into the URL."""

    def __init__(self, stack: ExitStack) -> None:
        self._stack = stack
        self._paths: dict[str, str] = {}

    def through(self, url: str) -> str:
        for name, door in DOORS.items():
            if f"{{{name}}}" in url and name not in self._paths:
                self._paths[name] = self._stack.enter_context(door()).path
        return url.format(**self._paths)


@pytest.fixture(scope="session")
def doors() -> Iterator[Doors]:
    with ExitStack() as stack:
        yield Doors(stack)


@pytest.fixture(params=URLS)
def session(request: pytest.FixtureRequest, doors: Doors) -> Iterator[Session]:
    rig = open_rig(doors.through(request.param), PROFILE)
    yield Session(rig)
    rig.close()


@pytest.fixture(params=URLS)
def at_rest(request: pytest.FixtureRequest) -> Iterator[Session]:
    """A rig that nobody has flown before."""
    with ExitStack() as stack:
        rig = open_rig(Doors(stack).through(request.param), PROFILE)
        yield Session(rig)
        rig.close()


def test_every_registered_driver_says_whether_it_needs_hardware():
    known = set(WITHOUT_HARDWARE) | NEEDS_HARDWARE
    assert {name for name, e in registered().items() if e.module.startswith("heli3dof")} <= known


@pytest.mark.parametrize("scheme", sorted(WITHOUT_HARDWARE))
def test_a_driver_names_its_scheme_and_options_and_finds_in_no_time(scheme: str):
    driver = load_driver(scheme)
    assert driver.scheme == scheme
    start = time.monotonic()
    for url in driver.find():
        assert parse_url(url).scheme == scheme
    assert time.monotonic() - start < 1.0
    with pytest.raises(UsageError) as caught:
        open_rig(f"{scheme}:?no_such_option=1", PROFILE)
    assert all(option in str(caught.value) for option in driver.options)


def test_the_identity_is_complete(session: Session):
    identity = session.rig.identity
    texts = (identity.driver, identity.model, identity.serial, identity.firmware, identity.protocol)
    assert all(texts)
    e = PROFILE.encoder
    assert identity.counts_per_rev == (e.roll, e.pitch, e.yaw)
    assert identity.v_max == LIMIT
    assert 2 * PROFILE.dt <= identity.watchdog_s <= 1.0
    assert identity.timebase in ("host", "device", "virtual")


def test_before_arming_no_volt_gets_out(session: Session):
    try:
        sample = session.send(5.0, 5.0)
    except DeviceError:
        return
    assert sample.v_applied == (0.0, 0.0)
    assert not sample.flags & Flags.ENABLED


def test_arming_enables_at_zero_volts(session: Session):
    before = time.monotonic()
    sample = session.arm()
    assert sample.flags == Flags.ENABLED
    assert sample.v_applied == (0.0, 0.0)
    assert before <= sample.host_time_s <= time.monotonic()


def test_a_sample_echoes_the_commands_sequence_and_its_volts(session: Session):
    session.arm()
    sent, at_once = {0: (0.0, 0.0)}, 0
    for k in range(40):
        volts = (3.0 + 0.1 * k, -2.0)
        sent[session.sequence + 1] = volts
        sample = session.send(*volts)
        assert sample.v_applied == pytest.approx(sent[sample.sequence], abs=0.01)
        assert sample.flags == Flags.ENABLED
        at_once += sample.sequence == session.sequence
    assert at_once >= 20  # the others came late on a busy machine's line


def test_the_devices_clock_advances_by_the_control_period(session: Session):
    last = session.arm().device_time_s
    session.send(0.0, 0.0)
    times = [session.send(0.0, 0.0).device_time_s for _ in range(50)]
    assert all(b > a for a, b in pairwise([last, *times]))
    steps = sorted(b - a for a, b in pairwise(times))
    assert steps[len(steps) // 2] == pytest.approx(PROFILE.dt, rel=0.05)


def test_volts_stay_within_the_limit_and_the_sample_owns_up_to_it(session: Session):
    session.arm()
    sample = session.hold(10 * LIMIT, -10 * LIMIT)
    assert sample.v_applied == pytest.approx((LIMIT, -LIMIT), abs=0.01)
    assert sample.flags & Flags.SATURATED
    assert not session.hold(1.0, 1.0).flags & Flags.SATURATED


def test_currents_are_numbers_of_the_voltages_sign_or_nan(session: Session):
    session.arm()
    for _ in range(5):
        sample = session.hold(6.0, -6.0)
    for ampere, sign in zip(sample.current, (1, -1), strict=True):
        assert math.isnan(ampere) or ampere * sign > 0


def test_an_emergency_stop_is_zero_volts_until_armed_however_often_it_is_called(session: Session):
    session.arm()
    session.send(5.0, 5.0)
    session.rig.estop("test")
    session.rig.estop("test, again")
    for _ in range(3):
        sample = session.send(5.0, 5.0)
        assert sample.v_applied == (0.0, 0.0)
        assert sample.flags & Flags.ESTOP
        assert not sample.flags & Flags.ENABLED
    assert session.arm().flags == Flags.ENABLED
    assert session.hold(5.0, 5.0).v_applied == pytest.approx((5.0, 5.0), abs=0.01)


def test_an_emergency_stop_is_heard_before_arming_too(session: Session):
    session.rig.estop("test")
    session.arm()
    assert session.hold(2.0, 2.0).flags == Flags.ENABLED


def test_a_voltage_that_is_not_a_number_never_reaches_the_motors(session: Session):
    session.arm()
    session.send(5.0, 5.0)
    with pytest.raises(DeviceError):
        session.send(math.nan, 5.0)
    assert session.send(5.0, 5.0).v_applied == (0.0, 0.0)


def test_closing_is_idempotent_and_final(session: Session):
    session.arm()
    session.rig.close()
    session.rig.close()
    session.rig.estop("after closing")
    with pytest.raises(DeviceError) as caught:
        session.send(1.0, 1.0)
    assert caught.value.fix
    with pytest.raises(DeviceError):
        session.rig.arm()


def test_a_silent_host_is_latched_out_until_it_arms_again(session: Session):
    identity = session.rig.identity
    if identity.timebase == "virtual":
        pytest.skip("a virtual clock stands still while the host is silent")
    session.arm()
    session.send(5.0, 5.0)
    time.sleep(identity.watchdog_s + 0.5)
    session.send(5.0, 5.0)
    sample = session.send(5.0, 5.0)
    assert sample.v_applied == (0.0, 0.0)
    assert sample.flags & Flags.LATCHED
    assert not sample.flags & Flags.ENABLED
    assert session.arm().flags == Flags.ENABLED
    assert session.hold(5.0, 5.0).v_applied == pytest.approx((5.0, 5.0), abs=0.01)


def test_equal_volts_lift_the_body_and_more_in_front_raises_the_front(at_rest: Session):
    session = at_rest
    if not session.rig.identity.emulated:
        pytest.skip("moves a real rig")
    start = session.arm().counts
    for _ in range(150):
        sample = session.send(12.0, 11.5)
    assert sample.counts[0] > start[0]
    assert sample.counts[1] > start[1]
    for _ in range(150):
        sample = session.send(11.5, 12.0)
    assert sample.counts[2] < start[2]  # front up: clockwise
