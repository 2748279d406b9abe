"""The bias correction gives correct inertias and intervals from step responses."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from heli3dof.diagnosis.search.steps import fit_with_cause, screening_step
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction import correction
from heli3dof.identification.bias_correction.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.identification.bias_correction.correction import scatter_of
from heli3dof.identification.bias_correction.perturbation import path
from heli3dof.identification.closed_loop_fit.base_fit import (
    LikelihoodWithInertiaPrior,
    corrected_base,
    fit_base,
    implausible_inertias,
)
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import default_profile, profile_from_dict
from tests.flown import flown

DEVICE = "mock:?speed=max&spread=0.07&seed=1002"


@cache
def steps(until_s: float = 24.0) -> Recording:
    return flown("steps", until_s, device=DEVICE, seed=1002)


def true_roll_inertia() -> float:
    """Return the emulated rig's roll inertia in units of the profile's K_f."""
    rig = open_driver(DEVICE, default_profile())
    body = rig.truth.body  # type: ignore[attr-defined]
    rig.close()
    return float((body.J[0] + body.dJ[0]) * default_profile().motor.K_f / body.K_f)


@pytest.mark.accuracy
def test_on_steps_the_corrected_roll_inertia_is_right_and_the_plain_one_is_not() -> None:
    recording, truth = steps(90.0), true_roll_inertia()
    plain = fit_greybox(recording, ())
    corrected = fit_base(Setup((recording,), seed=0, flights_per_round=6))
    assert abs(plain.values[1] - truth) > 3 * plain.std[1]
    assert abs(corrected.values[1] - truth) < 3 * corrected.std[1]
    assert abs(corrected.values[1] / truth - 1) < 0.03


def test_the_prior_of_the_inertias_is_the_profile_s_tolerance() -> None:
    recording = steps().between(10.0, 14.0)
    data = data_of([recording], usable_runs(recording, 0))
    problem = LikelihoodWithInertiaPrior(data, Structure(recording.profile, ()))
    np.testing.assert_allclose(problem.prior_precision[1:4], 1 / 0.15**2)


def test_a_score_bias_moves_the_maximum_by_the_equivalent_step() -> None:
    recording = steps().between(8.0, 24.0)
    data = data_of([recording], usable_runs(recording, 0))
    problem = LikelihoodWithInertiaPrior(data, Structure(recording.profile, ()))
    noise = np.array([0.006, 0.013, 0.0025, 0.0])
    plain = maximise_corrected(problem, problem.prior_mean, noise, None, hold_noise=True)
    A = plain.information + np.diag(problem.prior_precision)
    wanted = np.array([0.0, 0.5, 0.0, 0.0]) * np.sqrt(np.diag(np.linalg.inv(A)))
    bias = ScoreBias(-A @ wanted, np.zeros(3), plain.theta, noise)
    moved = maximise_corrected(problem, plain.theta, noise, bias, hold_noise=True)
    sd = np.sqrt(np.diag(np.linalg.inv(A)))
    np.testing.assert_allclose((moved.theta - plain.theta) / sd, wanted / sd, atol=0.15)


def test_held_parameters_stay_fixed_in_the_search() -> None:
    recording = steps().between(8.0, 20.0)
    data = data_of([recording], usable_runs(recording, 0))
    problem = LikelihoodWithInertiaPrior(data, Structure(recording.profile, ()))
    noise = np.array([0.006, 0.013, 0.0025, 0.0])
    start = problem.prior_mean + np.array([0.0, 0.1, 0.1, 0.1])
    hold = np.array([False, True, False, False])
    fit = maximise_corrected(problem, start, noise, None, hold_noise=True, hold=hold)
    assert fit.theta[1] == start[1]
    assert np.all(fit.theta[2:] != start[2:])


def test_a_path_has_one_chunk_per_10_ms() -> None:
    recording = steps().between(10.0, 12.0)
    problem = LikelihoodWithInertiaPrior(
        data_of([recording], usable_runs(recording, 0)), Structure(recording.profile, ())
    )
    noise = np.array([0.006, 0.013, 0.0025, 0.0])
    at = problem.run(problem.prior_mean, noise, keep=2)
    p = path(problem.structure, problem.values(problem.prior_mean), problem.data, at)
    assert len(p.chunk) == 200
    assert np.diff(p.t).max() < 0.011


@pytest.mark.parametrize(("size", "expected"), [(0.5, 1.0), (1.0, 1.0), (2.0, 4.0)])
def test_the_scatter_of_few_flights_is_at_least_that_of_exact_scores(
    size: float, expected: float
) -> None:
    H = np.array([[4.0, 1.0], [1.0, 9.0]])
    # Two scores of ± size √(H_jj/2): their variance is size² H_jj.
    flights = np.array([[1.0], [-1.0]]) * size / np.sqrt(2) * np.sqrt(np.diag(H))
    assert scatter_of(flights, H) == pytest.approx(expected * H)


def test_a_fit_whose_simulated_flights_diverge_is_not_corrected(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = steps(12.0)
    problem = LikelihoodWithInertiaPrior(
        data_of([flight], usable_runs(flight, 0)), Structure(flight.profile, ())
    )
    start = (problem.prior_mean, np.array([0.004, 0.012, 0.003, 0.0]))
    for factor, corrected in ((1.0, True), (2 * correction.MAX_SCATTER, False)):
        monkeypatch.setattr(correction, "scatter_of", lambda g, H, f=factor: f * H)
        fit = correction.correct(problem, [start], [flight], seed=0, flights_per_round=2, rounds=1)
        assert fit.is_corrected is corrected
    # The start is no maximum; the uncorrected fit is.
    assert fit.optimum.converged
    assert fit.optimum.loglik > problem.loglik(*start).sum() + 10


SLUGGISH = (
    (14.47, 6.7, -4.47, 12.06, 2.96, -7.1, 2.236, -0.354),
    (14.47, -6.7, 4.47, 12.06, -2.96, 7.1, 2.236, 0.354),
)


def test_a_constant_pitch_torque_is_not_fitted_as_a_large_inertia() -> None:
    """A roll step does not excite pitch; 0.03 N·m on pitch are 1.4 V between the motors."""
    table = default_profile().to_dict()
    table["controller"] = {"K": SLUGGISH}
    profile = profile_from_dict(table)
    device = "mock:?speed=max&start=level&seed=1421&hide=bias.torque.pitch:0.03"
    plan = step_plan((10.0, None, None), settle_s=5.0, duration_s=10.0)
    recording = flown(plan, device=device, profile=profile, seed=1421)
    problem = LikelihoodWithInertiaPrior(
        data_of([recording], usable_runs(recording, 0)), Structure(profile, ())
    )
    setup = Setup((recording,), seed=0, flights_per_round=6)
    assert implausible_inertias(corrected_base(setup, problem))
    held = fit_base(setup)
    np.testing.assert_allclose(held.theta[1:4], held.problem.prior_mean[1:4], atol=0.1)
    step = screening_step(setup, held, 12).chosen(setup, None)
    assert step.choice is not None
    names = {step.choice.term.name, *step.choice.tied_with}
    assert "bias.torque.pitch" in names
    result = fit_with_cause(setup, step.fit, step.choice)
    assert not implausible_inertias(result)
    assert isinstance(result.problem, LikelihoodWithInertiaPrior)
    assert result.problem.std_per_tolerance == 1.0
