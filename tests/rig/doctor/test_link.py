"""The open rig's checks, on good and on faulty rigs; no rig is armed."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from heli3dof.rig.calibration import RestCounts
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
    readings = listened(rig)
    assert rig.armed == 0
    return replace(readings, took_s=[1e-4] * len(readings.took_s))


def listened(rig: FakeRig) -> link.Opened:
    with Session("fake://1", private=True) as session:
        return link.listen(StoppableRig(rig, session), PROFILE)


def results_of(**driver: object) -> dict[str, Check]:
    readings = opened(**driver)
    return {check.what: check for check in (each(readings) for each in link.CHECKS)}


def test_a_good_rig_passes():
    results = results_of()
    assert not [c for c in results.values() if c.good is False]
    assert "fake rig, serial F-1, firmware 1.0" in results["identity"].found


def test_other_encoder_counts_than_the_profiles_fail():
    check = results_of(identity=replace(IDENTITY, counts_per_rev=(4096, 2048, 8192)))["identity"]
    assert check.good is False
    assert "encoder.pitch" in check.fix


def test_a_lower_voltage_limit_than_the_profiles_fails():
    check = results_of(identity=replace(IDENTITY, v_max=12.0))["identity"]
    assert check.good is False
    assert check.fix == "motor.v_max = 12 in the profile"


def test_a_long_watchdog_fails():
    check = results_of(identity=replace(IDENTITY, watchdog_s=0.9))["watchdog"]
    assert check.good is False
    assert "900 ms" in check.found


@pytest.mark.parametrize(
    ("flag", "good", "words"),
    [
        (Flags.FAULT, False, "fault"),
        (Flags.STALL, False, "stalled"),
        (Flags.ENABLED, False, "armed"),
        (Flags.LATCHED, True, "latched"),
        (Flags.ESTOP, True, "estop"),
        (Flags(0), True, "idle"),
    ],
)
def test_the_devices_state_is_reported(flag, good, words):
    script = {k: {"flags": flag} for k in range(link.POLLS + 1)}
    check = results_of(script=script)["state"]
    assert check.good is good
    assert words in check.found


def test_an_encoder_that_changes_at_rest_fails():
    check = results_of(script={9: {"counts": (0, 0, 17)}})["encoders at rest"]
    assert check.good is False
    assert "yaw changed by 17 counts" in check.found


def test_a_round_trip_longer_than_the_period_fails():
    slow = replace(opened(), took_s=[3e-3] * 100)
    check = link.round_trip(slow)
    assert check.good is False
    assert "3000 µs at the median" in check.found
    assert "too slow for 500 Hz" in check.found


def test_a_rare_long_round_trip_fails():
    pausing = replace(opened(), took_s=[1e-4] * 995 + [8e-3] * 5)
    check = link.round_trip(pausing)
    assert check.good is False
    assert "sometimes" in check.found


@pytest.mark.parametrize(
    ("retries", "malformed", "good"), [(0, 0, True), (2, 0, False), (0, 1, False)]
)
def test_repeated_requests_and_malformed_frames_fail(retries, malformed, good):
    check = link.loss(replace(opened(), retries=retries, malformed=malformed))
    assert check.good is good
    assert f"{retries} retries in 500" in check.found


def test_only_losses_during_the_readings_count():
    rig = FakeRig(FakeDriver())
    rig.statistics = SimpleNamespace(retries=7, malformed=3)
    readings = listened(rig)
    assert (readings.retries, readings.malformed) == (0, 0)


def test_a_fast_device_clock_fails():
    readings = opened()
    stretched = [replace(s, device_time_s=1.05 * s.host_time_s) for s in readings.samples]
    check = link.device_clock(replace(readings, samples=stretched, took_s=[1e-4] * 500))
    assert check.good is False
    assert "+5.00 %" in check.found


@pytest.mark.parametrize(("timebase", "good"), [("host", None), ("device", False)])
def test_a_clock_that_does_not_advance_fails_only_if_the_device_keeps_time(timebase, good):
    seen = opened(identity=replace(IDENTITY, timebase=timebase))
    still = [replace(s, device_time_s=0.0) for s in seen.samples]
    check = link.device_clock(replace(seen, samples=still, took_s=[1e-4] * 500))
    assert check.good is good


def test_assumed_rest_angles_are_reported():
    seen = opened()
    seen.rig.rest = RestCounts((0, 0, 0), "power-up", "the device has restarted")
    check = link.rest_angles(seen)
    assert check.good is None
    assert "has restarted" in check.found
    assert check.fix == "heli3dof zero"


def test_a_rig_away_from_its_rest_angles_is_reported():
    check = results_of(counts=(0, 100, 0))["rest angles"]
    assert check.good is None
    assert "pitch +8.8°" in check.found


@pytest.mark.parametrize(
    ("counts", "words", "fix"),
    [
        ((0, 1_073_741_824, 0), "pitch reads 94371840.0°, beyond", "counter has another width"),
        ((-(2**31), 0, 0), "roll reads -188743707.5°", "counter has another width"),
        ((1100, 0, 0), "roll reads 69.2°, beyond the envelope's -32° to 34°", "heli3dof zero"),
        ((0, 0, 20000), "yaw reads 878.9°", "heli3dof zero"),
    ],
)
def test_angles_outside_the_envelope_fail(counts, words, fix):
    check = results_of(counts=counts)["rest angles"]
    assert check.good is False
    assert words in check.found
    assert fix in check.fix
