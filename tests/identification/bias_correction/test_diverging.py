"""The search stays finite and continues when the simulated rig diverges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction import corrected_maximum
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.evaluation import Evaluation, evaluate
from heli3dof.identification.greybox.likelihood import Likelihood, diverged
from heli3dof.identification.greybox.maximum_likelihood import NOISE_START
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.linearisation import balance
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.parametrisation import Structure
from tests.flown import flown

NOISE = np.array(NOISE_START)


@pytest.fixture(scope="module")
def problem() -> Likelihood:
    plan = step_plan((10.0, None, None), settle_s=2.0, duration_s=18.0)
    flight = flown(plan, device="mock:?speed=max&start=level", seed=5)
    structure = Structure(flight.profile, terms(["friction.viscous.roll", "friction.coulomb.roll"]))
    return Likelihood(data_of([flight], usable_runs(flight, 0)), structure)


@pytest.fixture(params=["allowed", "senseless"])
def far(request: pytest.FixtureRequest, problem: Likelihood) -> np.ndarray:
    """Negative dry friction, at its bound and far beyond it: it accelerates every motion."""
    theta = problem.prior_mean.copy()
    theta[-1] = problem.bounds[0][-1] * (1 if request.param == "allowed" else 10)
    return theta


@pytest.mark.filterwarnings("error")
def test_tangents_come_from_the_simulation_where_first_order_perturbations_diverge(
    problem: Likelihood, far: np.ndarray
) -> None:
    result = evaluate(problem, far, NOISE)
    assert pytest.approx(problem.tangents(far, result.at), abs=1e-9) == result.T
    assert np.abs(result.T).max() < 1.0
    for each in (result.g, result.H, result.slope, result.curvature):
        assert np.isfinite(each).all()


@pytest.mark.filterwarnings("error")
def test_a_search_from_a_diverging_start_recovers(problem: Likelihood, far: np.ndarray) -> None:
    start = np.clip(far, *problem.bounds)
    result = maximise_corrected(problem, start, NOISE, None, hold_noise=True)
    assert result.loglik > problem.loglik(start, NOISE).sum() + 100
    assert abs(result.theta[-1]) < 0.8 * abs(start[-1]), "the emulated rig has no dry friction"


@pytest.mark.filterwarnings("error")
def test_a_step_that_is_not_finite_is_not_taken(
    problem: Likelihood, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_number(
        p: Likelihood, theta: np.ndarray, noise: np.ndarray, *, with_noise_derivatives: bool
    ) -> Evaluation:
        return replace(
            evaluate(p, theta, noise, with_noise_derivatives=with_noise_derivatives),
            g=np.full(len(theta), np.nan),
        )

    monkeypatch.setattr(corrected_maximum, "evaluate", no_number)
    result = maximise_corrected(problem, problem.prior_mean, NOISE, None, hold_noise=True)
    assert result.theta.tolist() == problem.prior_mean.tolist()
    assert not result.converged


def test_diverged_tangents_are_detected_per_coordinate() -> None:
    D = np.array([[1.0, 2.0], [1.0, 1e200], [np.nan, 0.0], [3.0, -4.0]])
    assert diverged(D).tolist() == [False, True, True, False]


def test_hover_thrusts_are_finite_for_extreme_parameters(problem: Likelihood) -> None:
    s = problem.structure
    values = problem.values(problem.prior_mean)
    values[1:4] = 1e-300
    model = GreyBoxModel(
        "x", s.profile, tuple(t.name for t in s.terms), values, NOISE[:3],
        np.full((len(values), len(values)), np.nan), 0.0,
    )  # fmt: skip
    assert np.isfinite(balance(model, np.array([0.3, 0.1, 0.0]))).all()
