"""Calibration needs a rig at rest."""

from __future__ import annotations

import math

import pytest

from heli3dof.errors import CheckFailed, SafetyTrip, UsageError
from heli3dof.rig.interface import Flags
from heli3dof.rig.profile import TABLE_I, default_profile, profile_from_dict
from heli3dof.rig.zero import calibrate, zero
from tests.rig.fakes import FakeDriver, FakeRig

PROFILE = default_profile()


def zeroed(driver, angles=(None, None, None), profile=PROFILE):
    return calibrate(FakeRig(driver), profile, "fake://1", angles, 0.05)


def test_at_rest_the_counts_are_the_medians():
    driver = FakeDriver(counts=(12, -3, 40), script={2: {"counts": (13, -3, 41)}})
    result = zeroed(driver)
    assert result.counts_at_rest == (12, -3, 40)
    assert (result.serial, result.boot, result.device) == ("F-1", 7, "fake://1")


def test_at_level_the_rest_angle_is_27_and_a_half_degrees_below():
    # 27.5° of 4096 counts a revolution are 312.9 counts.
    assert zeroed(FakeDriver(counts=(100, 5, 7)), (0.0, None, None)).counts_at_rest == (-213, 5, 7)


def test_an_encoder_that_counts_down_is_zeroed_too():
    data = {**TABLE_I, "encoder": {"roll": -4096, "pitch": 4096, "yaw": 8192}}
    profile = profile_from_dict(data)
    assert zeroed(FakeDriver(), (0.0, None, None), profile).counts_at_rest == (313, 0, 0)


def test_a_swinging_rig_is_refused_with_the_axis_and_its_motion():
    driver = FakeDriver(script={3: {"counts": (0, 30, 0)}})
    with pytest.raises(CheckFailed, match=r"pitch moved by 2\.64° \(30 counts\)"):
        zeroed(driver)


def test_an_armed_rig_is_refused_and_not_changed():
    driver = FakeDriver(script={1: {"flags": Flags.ENABLED}})
    with pytest.raises(SafetyTrip, match="armed"):
        zeroed(driver)


def test_zero_never_arms():
    rig = FakeRig(FakeDriver())
    calibrate(rig, PROFILE, "fake://1", (None, None, None), 0.05)
    assert rig.armed == 0


@pytest.mark.parametrize("angles", [(500.0, None, None), (None, None, math.nan)])
def test_an_angle_at_which_no_rig_can_stand_is_refused(angles):
    with pytest.raises(UsageError, match="The rig cannot stand at"):
        zero("mock:", angles_deg=angles)
