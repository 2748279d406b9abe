"""Where a search meets a rig that diverges, every number stays finite and the search goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.diagnosis import tilted
from heli3dof.diagnosis.looks import Look, look
from heli3dof.diagnosis.tilted import maximise_tilted
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.greybox.likelihood import Likelihood, diverged
from heli3dof.identification.greybox.maximum_likelihood import NOISE_START
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.effects import terms
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.linearisation import balance
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.physics.parametrisation import Structure

NOISE = np.array(NOISE_START)


@pytest.fixture(scope="module")
def problem() -> Likelihood:
    plan = step_plan((10.0, None, None), settle_s=2.0, duration_s=18.0)
    flight = fly_plan(plan, device="mock:?speed=max&start=level", seed=5).recording
    structure = Structure(flight.profile, terms(["friction.viscous.roll", "friction.coulomb.roll"]))
    return Likelihood(data_of([flight], usable_runs(flight, 0)), structure)


@pytest.fixture(params=["allowed", "senseless"])
def far(request: pytest.FixtureRequest, problem: Likelihood) -> np.ndarray:
    """Dry friction below zero, at its bound and far beyond it: it pushes whatever moves."""
    theta = problem.prior_mean.copy()
    theta[-1] = problem.bounds[0][-1] * (1 if request.param == "allowed" else 10)
    return theta


@pytest.mark.filterwarnings("error")
def test_tangents_are_the_simulation_s_where_first_order_perturbations_diverge(
    problem: Likelihood, far: np.ndarray
) -> None:
    here = look(problem, far, NOISE)
    assert pytest.approx(problem.tangents(far, here.at), abs=1e-9) == here.T
    assert np.abs(here.T).max() < 1.0
    for each in (here.g, here.H, here.slope, here.bend):
        assert np.isfinite(each).all()


@pytest.mark.filterwarnings("error")
def test_a_search_that_starts_there_comes_back(problem: Likelihood, far: np.ndarray) -> None:
    begun = np.clip(far, *problem.bounds)
    found = maximise_tilted(problem, begun, NOISE, None, hold_noise=True)
    assert found.loglik > problem.run(begun, NOISE, keep=0).loglik.sum() + 100
    assert abs(found.theta[-1]) < 0.8 * abs(begun[-1]), "the emulated rig has no dry friction"


@pytest.mark.filterwarnings("error")
def test_no_step_is_taken_that_is_not_a_number(
    problem: Likelihood, monkeypatch: pytest.MonkeyPatch
) -> None:
    def no_number(p: Likelihood, theta: np.ndarray, noise: np.ndarray, *, whole: bool) -> Look:
        return replace(look(p, theta, noise, whole=whole), g=np.full(len(theta), np.nan))

    monkeypatch.setattr(tilted, "look", no_number)
    found = maximise_tilted(problem, problem.prior_mean, NOISE, None, hold_noise=True)
    assert found.theta.tolist() == problem.prior_mean.tolist()
    assert not found.converged


def test_tangents_that_diverged_are_told_coordinate_by_coordinate() -> None:
    D = np.array([[1.0, 2.0], [1.0, 1e200], [np.nan, 0.0], [3.0, -4.0]])
    assert diverged(D).tolist() == [False, True, True, False]


def test_thrusts_that_hold_a_rig_of_senseless_numbers_are_finite(problem: Likelihood) -> None:
    s = problem.structure
    values = problem.values(problem.prior_mean)
    values[1:4] = 1e-300
    model = GreyBoxModel(
        "x", s.profile, tuple(t.name for t in s.terms), values, NOISE[:3],
        np.full((len(values), len(values)), np.nan), 0.0,
    )  # fmt: skip
    assert np.isfinite(balance(model, np.array([0.3, 0.1, 0.0]))).all()
