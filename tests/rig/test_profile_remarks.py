"""Unusual values of a profile are reported, usual ones are not."""

from __future__ import annotations

from typing import Any

import pytest

from heli3dof.rig.profile import TABLE_I, Profile, profile_from_dict
from heli3dof.rig.profile_file import merged, settings
from heli3dof.rig.profile_remarks import estimated_hover_voltage, mass_hover_voltage, unusual_values

BODY_HEAVY = {"mass": {"m_w": 1.87, "m_f": 0.713, "m_b": 0.713}, "motor": {"V_o": 3.94}}
"""The set of the older literature (signs consistent): 1.426 kg of body, 3.94 V per motor."""


def rig(*changes: str, base: dict[str, Any] = BODY_HEAVY) -> Profile:
    return profile_from_dict(merged(merged(TABLE_I, base), settings(changes)))


def test_a_consistent_profile_has_no_remarks() -> None:
    assert list(unusual_values(rig())) == []
    assert mass_hover_voltage(rig()) == pytest.approx(3.94, abs=0.05)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("motor.K_f=0.6", "motor.K_f = 0.6 N/V is unusual"),
        ("motor.K_f=0.02", "motor.K_f = 0.02 N/V is unusual"),
        ("encoder.yaw=100", "encoder.yaw = 100 counts/rev is unusual"),
        ("encoder.yaw=4097", "not a multiple of 4"),
        ("motor.V_o=-3.94", "wrong sign for a rig that rests body down"),
        ("mass.m_w=3", "but the masses give -29.3"),
        ("encoder.roll_rest_deg=-0.48", "in radians? -0.48 radians are -27.5 °"),
        ("motor.V_o=19", "79 % of motor.v_max"),
        ("geometry.L_h=1", "geometry.L_h = 1 m is unusual"),
        ("inertia.pitch=0.12", "inertia.pitch = 0.12 kg·m² is"),
        ("limits.roll_min_deg=-20", "would trip at once"),
    ],
)
def test_an_unusual_value_is_reported(change: str, words: str) -> None:
    assert words in "\n".join(unusual_values(rig(change)))


def test_the_default_profile_has_no_remarks() -> None:
    """Its masses give −7.46 ± 11 V, which does not contradict 7.46 V."""
    assert list(unusual_values(profile_from_dict(TABLE_I))) == []


def test_a_missing_controller_is_reported() -> None:
    data = {k: v for k, v in merged(TABLE_I, BODY_HEAVY).items() if k != "controller"}
    assert "no [controller]" in "\n".join(unusual_values(profile_from_dict(data)))


@pytest.mark.parametrize(("rest_deg", "sign"), [(-27.5, 1), (20.0, -1)])
def test_the_estimated_hover_voltage_has_the_sign_of_minus_the_rest_angle(
    rest_deg: float, sign: int
) -> None:
    profile = rig(f"encoder.roll_rest_deg={rest_deg}", base={})
    assert estimated_hover_voltage(profile) == pytest.approx(sign * 7.456, abs=1e-3)
