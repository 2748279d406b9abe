"""K_f from the deviations of the other four parameters, and torques in SI from it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.identification.greybox.thrust_scale import (
    ThrustScale,
    of_ratios,
    thrust_gain_warning,
)
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.rig.profile import default_profile
from tests.flown import flown

SMALL_STD = np.full(4, 0.003)


def test_a_common_factor_on_all_parameters_is_the_thrust_gain() -> None:
    assert of_ratios(np.full(4, 1 / 1.4), SMALL_STD, 0.075).k == pytest.approx(1.4, rel=0.04)


@pytest.mark.parametrize("one", range(4))
def test_a_single_deviating_parameter_is_not_the_thrust_gain(one: int) -> None:
    x = np.ones(4)
    x[one] = 1.4
    assert of_ratios(x, SMALL_STD, 0.075).k == pytest.approx(1.0, abs=0.03)


def test_unknown_parameters_carry_no_information() -> None:
    stds = np.array([0.003, 5.0, 5.0, 5.0])
    one, four = (
        of_ratios(np.full(4, 0.9), stds, 0.075),
        of_ratios(np.full(4, 0.9), SMALL_STD, 0.075),
    )
    # T_g alone: half of the 10 % is its own, half is the thrust gain's.
    assert one.k == pytest.approx(0.9**-0.5, abs=0.01)
    assert four.k > one.k
    assert four.std < one.std


@given(st.lists(st.floats(-0.07, 0.07), min_size=5, max_size=5))
def test_rigs_within_seven_per_cent_are_estimated_within_the_interval(draws: list[float]) -> None:
    k, x = np.exp(draws[0]), np.exp(np.array(draws[1:]))
    scale = of_ratios(x / k, SMALL_STD, 0.075)
    assert abs(np.log(scale.k / k)) < 2.5 * scale.std


def test_a_torque_scales_with_it_and_a_time_does_not() -> None:
    scale = ThrustScale(1.1, 0.03)
    value, std = scale.to_si(2.0, 0.0, "N·m·s/rad")
    assert (value, std) == pytest.approx((2.2, 0.066))
    assert scale.to_si(0.1, 0.01, "s") == (0.1, 0.01)


@pytest.mark.parametrize(
    ("scale", "off"),
    [
        (ThrustScale(1.15 * 1.01, 0.07), True),  # ln(1.15·1.01) = 0.150 > 2·0.07
        (ThrustScale(1.15 * 1.01, 0.08), False),
        (ThrustScale(0.85 / 1.01, 0.07), True),
        (ThrustScale(1.14, 0.001), False),  # within the tolerance
    ],
)
def test_a_thrust_gain_is_off_beyond_the_tolerance_and_two_standard_deviations(
    scale: ThrustScale, off: bool
) -> None:
    assert scale.is_off(0.15) is off


@pytest.mark.parametrize(("gain", "stated"), [("0.7", True), ("1.05", False)])
def test_identify_states_another_thrust_gain(gain: str, stated: bool) -> None:
    device = f"mock:?speed=max&seed=5&hide=motor.thrust_gain:{gain}"
    flight = flown("multisine", 40.0, device=device, seed=5)
    warning = thrust_gain_warning(fit_greybox(flight))
    assert [": T_g, J_roll, J_pitch, J_yaw. " in w for w in warning] == [True] * stated


def test_the_warning_names_only_the_numbers_that_deviate_alike() -> None:
    """T_g = 2 L_a K_f V_o of the profile: with a wrong K_f, but the right V_o, it fits."""
    (warning,) = thrust_gain_warning(fit_with_ratios(1.0, 3.9, 4.0, 3.8))
    assert ": J_roll, J_pitch, J_yaw. " in warning


def test_a_factor_that_is_common_within_the_tolerance_is_the_thrust_gain() -> None:
    """K_f = 0.15 in the profile of a rig with 0.1188; its other numbers are 1 to 2 % off."""
    (warning,) = thrust_gain_warning(fit_with_ratios(1.262, 1.269, 1.242, 1.264))
    assert ": T_g, J_roll, J_pitch, J_yaw. " in warning


@pytest.mark.parametrize(
    "ratios", [(1.0, 1.5, 1.0, 1.02), (1.14, 1.13, 1.12, 1.14), (1.3, 0.98, 1.3, 1.0)]
)
def test_one_wrong_axis_or_a_profile_within_its_tolerance_gives_no_warning(
    ratios: tuple[float, ...],
) -> None:
    assert thrust_gain_warning(fit_with_ratios(*ratios)) == ()


def fit_with_ratios(*ratios: float) -> Any:
    """A fit whose T_g and inertias are ``ratios`` of those in the profile."""
    structure = Structure(default_profile(), ())
    values = structure.start * ratios
    return SimpleNamespace(
        structure=structure, free=structure.free, values=values, std=0.01 * values
    )
