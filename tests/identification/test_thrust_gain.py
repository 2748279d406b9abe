"""One factor on all three inertias is stated as a wrong thrust gain, three factors are not."""

from __future__ import annotations

from math import log

import numpy as np
import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.identification.greybox.thrust_gain import common_factor, thrust_gain_warnings

TIGHT = np.diag([0.01, 0.02, 0.01]) ** 2


def test_the_factor_is_the_weighted_mean_of_the_log_ratios() -> None:
    """s = 0.1/2 and σ = 0: equal weights, σ of the mean 0.05/√3."""
    found = common_factor(np.log([1.2, 1.25, 1.3]), np.zeros((3, 3)), 0.1)
    assert found is not None
    assert found.factor == pytest.approx((1.2 * 1.25 * 1.3) ** (1 / 3))
    assert log(found.high / found.factor) == pytest.approx(1.96 * 0.05 / 3**0.5)
    assert log(found.factor / found.low) == pytest.approx(1.96 * 0.05 / 3**0.5)


@pytest.mark.parametrize(
    ("ratios", "covariance"),
    [
        ([1.27, 1.0, 1.0], TIGHT),  # one inertia is wrong
        ([1.1, 1.1, 1.1], TIGHT),  # within the tolerance
        ([1.27, 1.27, 1.27], np.full((3, 3), 0.2**2) + TIGHT),  # the factor is not known
    ],
)
def test_no_factor_is_stated_if_the_ratios_do_not_show_it(
    ratios: list[float], covariance: np.ndarray
) -> None:
    assert common_factor(np.log(ratios), covariance, 0.15) is None


def test_correlated_errors_do_not_hide_the_factor() -> None:
    """Inertias with a common error of 5 %: 1.96·√(0.05² + 0.075²/3) = 0.13 < ln 1.27."""
    common = np.full((3, 3), 0.05**2) + TIGHT
    found = common_factor(np.log([1.27, 1.27, 1.27]), common, 0.15)
    assert found is not None
    assert found.factor == pytest.approx(1.27)
    words = found.sentence(0.1188)
    assert "All three inertias are 1.27 times the profile's (95 % interval 1.1" in words
    assert "motor.K_f is 0.0935 N/V" in words
    assert "heli3dof profile update --from" in words


@pytest.mark.parametrize(("gain", "stated"), [("0.75", True), ("1.05", False)])
def test_a_flight_of_a_rig_with_another_thrust_gain(gain: str, stated: bool) -> None:
    device = f"mock:?speed=max&seed=5&hide=motor.thrust_gain:{gain}"
    flight = fly_plan(load_plan("multisine"), device=device, seed=5).recording
    warnings = thrust_gain_warnings(fit_greybox(flight))
    assert [w.startswith("All three inertias are 1.") for w in warnings] == [True] * stated
