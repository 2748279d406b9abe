"""A base parameter is a finding if it is significantly outside the profile's tolerance."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.stats import norm

from heli3dof.diagnosis.base_parameters import (
    OffNominal,
    base_parameters,
    off_nominal,
    quantile,
)
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.rig.profile import default_profile

NAMES = ("T_g", "J_roll", "J_pitch", "J_yaw")


class Fit(CorrectedFit):
    """A fit by likelihood with the given attributes and nothing else."""

    free = values = std = structure = cast(Any, None)

    def __init__(self, **attributes: Any) -> None:
        vars(self).update(attributes)


def rig(ratio: tuple[float, ...] = (1, 1, 1, 1), relative_std: float = 0.003) -> Estimate:
    """Return a base fit with these ratios to nominal and relative standard deviations."""
    start = np.array([1.17, 0.91, 0.036, 0.95])
    units = ("N·m", "kg·m²", "kg·m²", "kg·m²")
    free = [SimpleNamespace(name=n, start=s, unit=u, log=n != "T_g")
            for n, s, u in zip(NAMES, start, units, strict=True)]  # fmt: skip
    values = start * np.array(ratio)
    return cast(Any, Fit(
        free=free, values=values, std=relative_std * values,
        structure=SimpleNamespace(profile=default_profile(), free=free),
        covariance_with_edge_rates=None,
    ))  # fmt: skip


def names(off: tuple[OffNominal, ...]) -> list[str]:
    return [o.term.name for o in off]


def test_the_quantile_gives_five_parameters_a_false_alarm_rate_of_0_003() -> None:
    assert 5 * norm.sf(quantile()) == pytest.approx(0.003)


def test_a_significant_deviation_is_a_finding_and_one_within_tolerance_is_not() -> None:
    assert names(off_nominal(rig((1, 1, 1.4, 1)))) == ["inertia.pitch"]
    assert names(off_nominal(rig((0.6, 1, 1, 1)))) == ["mass.imbalance"]
    assert names(off_nominal(rig((1, 1, 1.12, 1)))) == []


def test_the_confidence_is_the_probability_of_being_beyond_the_tolerance() -> None:
    # The estimated ratio 1.380 is 0.182 beyond ln 1.15. σ is √(0.0377² + (3 · 0.003)²) = 0.0388.
    (off,) = off_nominal(rig((1, 1, 1.4, 1)))
    assert norm.ppf(off.confidence) == pytest.approx(0.182 / 0.0388, rel=0.02)


def test_a_common_factor_on_all_parameters_is_the_thrust_gain() -> None:
    assert names(off_nominal(rig((0.6,) * 4))) == ["motor.thrust_gain"]


def test_two_standard_deviations_are_not_enough() -> None:
    # ln 1.4 = 0.336 exceeds e by 0.197; the estimated K_f absorbs 0.02 of it. That is 2.2 combined
    # standard deviations (σ = 0.065, σ_k = 0.048), but 0.8 of what q = 3.24 requires.
    fit = rig((1, 1, 1.4, 1), relative_std=0.065)
    pitch = base_parameters(fit)[3]
    assert pitch.excess(0.15) > 2 * np.hypot(pitch.noise_std, pitch.scale)
    assert names(off_nominal(fit)) == []


def test_without_edge_rates_the_standard_deviation_counts_three_times() -> None:
    # ln 1.8 = 0.588 exceeds e by 0.448: 2.3 times 3.24 · 0.06.
    fit = rig((1, 1, 1.8, 1), relative_std=0.06)
    assert names(off_nominal(fit)) == []
    vars(fit)["covariance_with_edge_rates"] = np.eye(4)
    assert names(off_nominal(fit)) == ["inertia.pitch"]


def test_a_torque_of_the_wrong_sign_is_always_a_finding() -> None:
    assert names(off_nominal(rig((-0.5, 1, 1, 1)))) == ["mass.imbalance"]


@pytest.mark.parametrize(
    ("ratio", "found"),
    [
        # ln(1.19/0.82) = 0.372 > ln(1.15/0.85) + 3.24 · 3 · 0.003 √2 = 0.344
        ((1, 1, 0.82, 1.19), ["inertia.pitch", "inertia.yaw"]),
        ((1, 1, 0.83, 1.13), []),  # 0.309: a thrust gain 2 % too small explains both
        ((1, 1, 0.74, 1.08), ["inertia.pitch"]),  # the yaw inertia is within the tolerance
    ],
)
def test_a_ratio_beyond_two_tolerances_is_a_finding_whatever_the_thrust_gain(
    ratio: tuple[float, ...], found: list[str]
) -> None:
    assert sorted(names(off_nominal(rig(ratio)))) == found
