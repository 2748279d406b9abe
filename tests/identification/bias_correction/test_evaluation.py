"""Evaluation of the score on a short flight: the likelihood's slope along the noise and θ."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.correction import NoiseScoreBias
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from tests.flown import flown


@pytest.fixture(scope="module")
def problem() -> LikelihoodWithInertiaPrior:
    flight = flown(
        step_plan((10, None, 20), settle_s=4, duration_s=3), device="mock:?speed=max", seed=1203
    )
    data = data_of([flight], usable_runs(flight, 0))
    return LikelihoodWithInertiaPrior(data, Structure(flight.profile, ()))


def test_the_slope_along_the_noise_is_a_central_difference_of_the_likelihood(
    problem: LikelihoodWithInertiaPrior,
) -> None:
    theta, noise = problem.prior_mean, np.array([0.1, 0.1, 0.05, 0.0])
    result = evaluate(problem, theta, noise)
    step = np.exp([0.5, 0.5, 0.5, 0.0])
    up, down = (problem.loglik(theta, a) for a in (noise * step, noise / step))
    np.testing.assert_allclose(result.slope, up - down)
    np.testing.assert_allclose(result.curvature, (up - 2 * result.at.loglik + down) / 0.25)


def test_without_the_noise_an_evaluation_is_the_same_with_a_third_of_the_passes(
    problem: LikelihoodWithInertiaPrior,
) -> None:
    theta, noise = problem.prior_mean, np.array([0.1, 0.1, 0.05, 0.0])
    whole, part = (
        evaluate(problem, theta, noise),
        evaluate(problem, theta, noise, with_noise_derivatives=False),
    )
    np.testing.assert_array_equal(whole.g, part.g)
    np.testing.assert_array_equal(whole.H, part.H)
    assert not part.slope.any()


def test_the_score_bias_is_evaluated_again_after_a_large_move() -> None:
    zero, at, sd = np.zeros(3), np.zeros(2), np.array([1.0, 0.1])
    bias = NoiseScoreBias(zero, zero, at, np.ones(4), sd)
    near = np.array([1.0, np.exp(0.29), 1.0, 1.0])
    assert not bias.is_outdated(np.array([2.9, -0.29]), near)
    assert bias.is_outdated(np.array([0.0, 0.31]), np.ones(4)), (
        "more than three standard deviations"
    )
    assert bias.is_outdated(at, np.array([1.0, 1.0, np.exp(-0.31), 1.0]))
