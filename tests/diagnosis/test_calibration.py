"""A base parameter is a finding where it is surely off by more than the profile's tolerance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.calibration import Off, calibrated, off_nominal, quantile
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.rig.profile import default_profile

NAMES = ("T_g", "J_roll", "J_pitch", "J_yaw")


def rig(ratio: tuple[float, ...] = (1, 1, 1, 1), told: float = 0.003) -> Estimate:
    """A fit of the base: its four numbers over nominal, each known to a share ``told``."""
    start = np.array([1.17, 0.91, 0.036, 0.95])
    units = ("N·m", "kg·m²", "kg·m²", "kg·m²")
    free = [SimpleNamespace(name=n, start=s, unit=u, log=n != "T_g")
            for n, s, u in zip(NAMES, start, units, strict=True)]  # fmt: skip
    values = start * np.array(ratio)
    return cast(Any, SimpleNamespace(
        free=free, values=values, std=told * values,
        structure=SimpleNamespace(profile=default_profile()),
    ))  # fmt: skip


def names(off: tuple[Off, ...]) -> list[str]:
    return [o.term.name for o in off]


def test_the_quantile_makes_five_parameters_falsely_named_in_three_of_a_thousand() -> None:
    from scipy.stats import norm

    assert 5 * norm.sf(quantile()) == pytest.approx(0.003)


def test_well_told_and_far_off_is_a_finding_and_within_the_tolerance_is_none() -> None:
    assert names(off_nominal(rig((1, 1, 1.4, 1)))) == ["inertia.pitch"]
    assert names(off_nominal(rig((0.6, 1, 1, 1)))) == ["mass.imbalance"]
    assert names(off_nominal(rig((1, 1, 1.12, 1)))) == []


def test_all_off_by_one_factor_is_the_thrust_gain() -> None:
    assert names(off_nominal(rig((0.6,) * 4))) == ["motor.thrust_gain"]


def test_two_standard_deviations_of_a_flight_s_noise_are_not_enough() -> None:
    # ln 1.4 = 0.336 is 0.197 beyond the edge, less 0.02 that the scale takes: 2.2 of the two
    # spreads together (0.065 of the flight, 0.048 of the scale), but 0.8 of the 3.24 asked for.
    fit = rig((1, 1, 1.4, 1), told=0.065)
    pitch = calibrated(fit)[3]
    assert pitch.beyond(0.15) > 2 * np.hypot(pitch.told, pitch.scale)
    assert names(off_nominal(fit)) == []


def test_what_the_scores_alone_tell_of_a_chattering_loop_is_believed_a_third_as_much() -> None:
    # ln 1.8 = 0.588 is 0.448 beyond the edge: 2.3 times 3.24 · 0.06.
    fit = rig((1, 1, 1.8, 1), told=0.06)
    assert names(off_nominal(fit)) == []
    assert names(off_nominal(fit, doubted=1.0)) == ["inertia.pitch"]


def test_what_is_off_only_for_want_of_a_leftover_s_name_is_not_off() -> None:
    fit = rig((1, 1.5, 1, 1))
    still, back = np.zeros(4), np.array([0.0, -0.4, 0.0, 0.0])
    std = np.full(4, 0.003)
    assert names(off_nominal(fit, beside=(still, std))) == ["inertia.roll"]
    assert names(off_nominal(fit, beside=(back, std))) == []
    assert names(off_nominal(fit, beside=(still, np.full(4, 0.2)))) == []


def test_a_torque_of_the_wrong_sign_is_off_for_sure() -> None:
    assert names(off_nominal(rig((-0.5, 1, 1, 1)))) == ["mass.imbalance"]
