"""In a limit cycle on one count, edge rates improve the estimate and its intervals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.correction import (
    CorrectedFit,
    model_at,
    simulate_again,
)
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.edge_rates import (
    fit_with_edge_rates,
    jacobian,
    moments_of_axis,
    weights,
)
from heli3dof.identification.closed_loop_fit.limit_cycle import edge_rates
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.estimation.filter_data import RowRange, data_of
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import default_profile
from tests.flown import flown
from tests.profiles import profile

MODULE = "heli3dof.identification.closed_loop_fit.edge_rates"
DEVICE = "mock:?speed=max&spread=0.07&seed=1022"


@pytest.fixture(scope="module")
def fitted() -> tuple[Setup, CorrectedFit]:
    rig = profile(rate_hz=250.0)
    whole = flown(step_plan((10.0, None, None)), device=DEVICE, seed=1022, profile=rig)
    setup = Setup((whole,), seed=0, flights_per_round=6)
    return setup, fit_base(setup)


def test_the_edge_rate_is_the_share_of_samples_with_a_count_change(
    fitted: tuple[Setup, CorrectedFit],
) -> None:
    flown = fitted[0].recordings[0]
    step = np.abs(flown.profile.encoder.rad_per_count)
    counts = np.array([[0, 0, 5], [0, 1, 5], [1, 0, 5], [1, 1, 5], [1, 1, 6]])
    part = replace(flown.rows(slice(0, 5)), angle=counts * step)
    # Four intervals: roll changes in one, pitch in three, yaw in one.
    assert edge_rates(data_of([part], [RowRange(0, 0, 5)])) == pytest.approx([0.25, 0.75, 0.25])


def test_the_inertias_lie_within_their_intervals(fitted: tuple[Setup, CorrectedFit]) -> None:
    _, fit = fitted
    assert fit.covariance_with_edge_rates is not None
    rig = open_driver(DEVICE, default_profile())
    body = rig.truth.body  # type: ignore[attr-defined]
    rig.close()
    truth = (np.array(body.J) + np.array(body.dJ)) * default_profile().motor.K_f / body.K_f
    relative_std = fit.std[1:4] / fit.values[1:4]
    assert np.all(np.abs(np.log(fit.values[1:4] / truth)) < 2.5 * relative_std)
    # Roll is stepped and well determined, pitch and yaw are only held.
    assert relative_std[0] < 0.03 < relative_std[1] < 0.15


@pytest.mark.accuracy
@pytest.mark.parametrize("seed", [3, 7])
def test_steps_converge(seed: int) -> None:
    whole = flown("steps", 60.0, device=f"mock:?speed=max&seed={seed}", seed=seed)
    assert fit_base(Setup((whole,), seed=0, flights_per_round=6)).optimum.converged


@pytest.mark.accuracy
def test_a_start_at_the_wrong_end_of_the_ridge_converges(
    fitted: tuple[Setup, CorrectedFit],
) -> None:
    setup, fit = fitted
    theta, a = fit.theta.copy(), fit.optimum.noise.copy()
    theta[2] += np.log(0.5)
    a[1] *= 4
    wrong = replace(fit, optimum=replace(fit.optimum, theta=theta, noise=a))
    back = fit_with_edge_rates(fit.problem, wrong, setup.recordings, seed=0, rounds=8)
    relative_std = fit.std[2] / fit.values[2]
    assert abs(np.log(back.values[2] / fit.values[2])) < 2 * relative_std
    assert back.optimum.noise[1] / fit.optimum.noise[1] == pytest.approx(1, rel=0.4)


def test_the_bias_is_that_of_simulated_flights_not_of_the_recording(
    fitted: tuple[Setup, CorrectedFit],
) -> None:
    """With a hidden cause the recordings' scores contain its trace and would bias the base."""
    setup, fit = fitted
    o, problem = fit.optimum, fit.problem
    model = model_at(problem, o.theta, o.noise)
    flown = [
        evaluate(replace(problem, data=data), o.theta, o.noise)
        for data in (
            simulate_again(model, setup.recordings, problem.data, (5, b)) for b in range(8)
        )
    ]
    g, slope = np.array([f.g for f in flown]), np.array([f.slope for f in flown])
    assert fit.bias is not None
    assert fit.noise_bias is not None
    several = 4 * np.sqrt(1 / 8 + 1 / fit.flights)
    assert (abs(g.mean(axis=0) - fit.bias) < several * g.std(axis=0, ddof=1)).all()
    assert (abs(slope.mean(axis=0) - fit.noise_bias) < several * slope.std(axis=0, ddof=1)).all()


def test_if_the_simulated_flights_diverge_the_fit_is_unchanged(
    fitted: tuple[Setup, CorrectedFit],
) -> None:
    setup, fit = fitted
    theta = fit.theta.copy()
    theta[0] = np.nan
    diverging = replace(fit, optimum=replace(fit.optimum, theta=theta))
    with np.errstate(all="ignore"):
        result = fit_with_edge_rates(fit.problem, diverging, setup.recordings, seed=0, flights=8)
    assert result is diverging


def test_if_the_search_ends_where_the_filter_diverges_the_fit_is_unchanged(
    fitted: tuple[Setup, CorrectedFit], monkeypatch: pytest.MonkeyPatch
) -> None:
    setup, fit = fitted
    diverged = replace(fit.optimum, loglik=-np.inf)
    monkeypatch.setattr(f"{MODULE}.optimum_at", lambda *_: diverged)
    result = fit_with_edge_rates(fit.problem, fit, setup.recordings, seed=0, flights=8, rounds=1)
    assert result is fit


def test_without_a_limit_cycle_edge_rates_are_not_used() -> None:
    flight = flown("rich", 22.0, device=DEVICE, seed=1022).between(6.0, 22.0)
    assert (
        fit_base(Setup((flight,), seed=0, flights_per_round=4)).covariance_with_edge_rates is None
    )


def test_the_three_moments_of_each_axis_are_weighted_by_their_covariance() -> None:
    C = np.diag(np.arange(1.0, 11.0))
    C[4, 7] = C[7, 4] = 5.0  # the slope along roll's noise, and roll's rate
    W = weights(C)
    block = np.ix_(moments_of_axis(0, 4), moments_of_axis(0, 4))
    ridge = 0.1 * np.diag(np.diag(C)[moments_of_axis(0, 4)])
    np.testing.assert_allclose(W[block] @ (C[block] + ridge), np.eye(3), atol=1e-12)
    assert W[0, 0] == pytest.approx(1 / 1.1)


def test_the_jacobian_has_simulated_effects_within_an_axis_and_the_information_elsewhere() -> None:
    effects = np.arange(60.0).reshape(6, 10)
    G = jacobian(np.full((4, 4), -1.0), effects)
    assert G[1, 1] == effects[0, 1]  # roll's score along roll's inertia
    assert G[8, 5] == effects[4, 8]  # pitch's rate along pitch's noise
    assert G[1, 2] == -1.0
    assert G[8, 1] == 0.0
