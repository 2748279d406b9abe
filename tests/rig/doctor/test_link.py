"""The open rig's checks, on rigs that are well and on rigs that are not. None is ever armed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from heli3dof.rig.calibration import Rest
from heli3dof.rig.doctor import link
from heli3dof.rig.interface import Check, Flags
from heli3dof.rig.profile import default_profile
from heli3dof.rig.session.server import Session
from heli3dof.rig.session.stoppable_rig import StoppableRig
from tests.rig.fakes import IDENTITY, FakeDriver, FakeRig

PROFILE = default_profile()


@pytest.fixture(autouse=True)
def at_once(monkeypatch):
    monkeypatch.setattr(link, "EVERY_S", 0.0)


def opened(**driver: object) -> link.Opened:
    rig = FakeRig(FakeDriver(**driver))
    held = StoppableRig(rig, Session("fake://1", private=True))
    found = link.listen(held, PROFILE)
    assert rig.armed == 0
    return replace(found, took_s=[1e-4] * len(found.took_s))


def looked_at(**driver: object) -> dict[str, Check]:
    seen = opened(**driver)
    return {check.what: check for check in (each(seen) for each in link.CHECKS)}


def test_a_rig_that_is_well_has_nothing_to_mend():
    found = looked_at()
    assert not [c for c in found.values() if c.good is False]
    assert "fake rig, serial F-1, firmware 1.0" in found["identity"].found


def test_another_rigs_profile_is_named_by_its_key():
    check = looked_at(identity=replace(IDENTITY, counts_per_rev=(4096, 2048, 8192)))["identity"]
    assert check.good is False
    assert "encoder.pitch" in check.fix


def test_a_weaker_amplifier_than_the_profiles_is_said():
    check = looked_at(identity=replace(IDENTITY, v_max=12.0))["identity"]
    assert check.good is False
    assert check.fix == "motor.v_max = 12 in the profile"


def test_a_long_watchdog_is_said():
    check = looked_at(identity=replace(IDENTITY, watchdog_s=0.9))["watchdog"]
    assert check.good is False
    assert "900 ms" in check.found


@pytest.mark.parametrize(
    ("flag", "good", "said"),
    [
        (Flags.FAULT, False, "fault"),
        (Flags.STALL, False, "stalled"),
        (Flags.ENABLED, False, "armed"),
        (Flags.LATCHED, True, "latched"),
        (Flags.ESTOP, True, "estop"),
        (Flags(0), True, "idle"),
    ],
)
def test_the_devices_state_is_said(flag, good, said):
    script = {k: {"flags": flag} for k in range(link.POLLS + 1)}
    check = looked_at(script=script)["state"]
    assert check.good is good
    assert said in check.found


def test_an_encoder_that_wanders_at_rest_is_named():
    check = looked_at(script={9: {"counts": (0, 0, 17)}})["encoders at rest"]
    assert check.good is False
    assert "yaw wandered by 17 counts" in check.found


def test_a_line_slower_than_the_loop_is_too_slow():
    slow = replace(opened(), took_s=[3e-3] * 100)
    check = link.round_trip(slow)
    assert check.good is False
    assert "3000 µs at the median" in check.found
    assert "too slow for 500 Hz" in check.found


def test_a_line_that_pauses_now_and_then_is_told_from_a_slow_one():
    pausing = replace(opened(), took_s=[1e-4] * 995 + [8e-3] * 5)
    check = link.round_trip(pausing)
    assert check.good is False
    assert "now and then" in check.found


@pytest.mark.parametrize(
    ("retries", "malformed", "good"), [(0, 0, True), (2, 0, False), (0, 1, False)]
)
def test_retries_and_malformed_frames_are_counted(retries, malformed, good):
    check = link.loss(replace(opened(), retries=retries, malformed=malformed))
    assert check.good is good
    assert f"{retries} retries in 500" in check.found


def test_only_what_was_lost_while_we_listened_counts():
    rig = FakeRig(FakeDriver())
    rig.statistics = SimpleNamespace(retries=7, malformed=3)
    held = StoppableRig(rig, Session("fake://1", private=True))
    found = link.listen(held, PROFILE)
    assert (found.retries, found.malformed) == (0, 0)


def test_a_device_whose_clock_runs_fast_is_found():
    seen = opened()
    stretched = [replace(s, device_time_s=1.05 * s.host_time_s) for s in seen.samples]
    check = link.device_clock(replace(seen, samples=stretched, took_s=[1e-4] * 500))
    assert check.good is False
    assert "+5.00 %" in check.found


@pytest.mark.parametrize(("timebase", "good"), [("host", None), ("device", False)])
def test_a_clock_that_stands_still_is_wrong_only_where_the_device_keeps_the_time(timebase, good):
    seen = opened(identity=replace(IDENTITY, timebase=timebase))
    still = [replace(s, device_time_s=0.0) for s in seen.samples]
    check = link.device_clock(replace(seen, samples=still, took_s=[1e-4] * 500))
    assert check.good is good


def test_rest_angles_that_are_an_assumption_are_said():
    seen = opened()
    seen.rig.rest = Rest((0, 0, 0), "power-up", "the device has restarted")
    check = link.rest_angles(seen)
    assert check.good is None
    assert "has restarted" in check.found
    assert check.fix == "heli3dof zero"


def test_a_rig_that_does_not_rest_where_it_should_is_said():
    check = looked_at(counts=(0, 100, 0))["rest angles"]
    assert check.good is None
    assert "pitch +8.8°" in check.found


@pytest.mark.parametrize(
    ("counts", "says", "mends"),
    [
        ((0, 1_073_741_824, 0), "pitch reads 94371840.0°, beyond", "counter is of another width"),
        ((-(2**31), 0, 0), "roll reads -188743707.5°", "counter is of another width"),
        ((1100, 0, 0), "roll reads 69.2°, beyond the envelope's -32° to 34°", "heli3dof zero"),
        ((0, 0, 20000), "yaw reads 878.9°", "heli3dof zero"),
    ],
)
def test_angles_that_would_end_a_flight_at_once_are_a_failure(counts, says, mends):
    check = looked_at(counts=counts)["rest angles"]
    assert check.good is False
    assert says in check.found
    assert mends in check.fix
