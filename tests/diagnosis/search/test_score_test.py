"""Score test on flights of the emulated rig: size, frequency, false alarms, and its parts."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.search.catalogue import candidates, probes, scans
from heli3dof.diagnosis.search.score_test import Screen, with_term
from heli3dof.identification.bias_correction.evaluation import Evaluation, evaluate
from heli3dof.identification.bias_correction.perturbation import backward, forcing, forward
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import term
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.recording.recording import Recording
from tests.flown import flown


def rich(seed: int, hide: str = "") -> Recording:
    device = f"mock:?speed=max&seed={seed}" + (f"&hide={hide}" if hide else "")
    return flown("rich", 40.0, device=device, seed=seed)


def fitted(recording: Recording) -> tuple[Estimate, Evaluation]:
    runs = usable_runs(recording, 0)
    fit = estimate(
        LikelihoodWithInertiaPrior(data_of([recording], runs), Structure(recording.profile, ()))
    )
    o = fit.optimum
    return fit, evaluate(fit.problem, o.theta, o.noise, with_noise_derivatives=False)


def screened(fit: Estimate, evaluation: Evaluation) -> Screen:
    terms = candidates()
    V = fit.problem.data.V
    plain = [p for t in terms for p in probes(t, V)]
    return Screen(fit.problem, fit.optimum.theta, evaluation, plain, scans(terms))


@pytest.fixture(scope="module")
def unmodified() -> tuple[Estimate, Evaluation]:
    return fitted(rich(1003))


def test_linearised_tangents_match_finite_differences_of_the_filter(
    unmodified: tuple[Estimate, Evaluation],
) -> None:
    fit, evaluation = unmodified
    differences = fit.problem.tangents(fit.optimum.theta, evaluation.at)
    for a, b in zip(evaluation.T, differences, strict=True):
        assert np.corrcoef(a, b)[0, 1] > 0.999
        assert np.std(a) == pytest.approx(np.std(b), rel=0.01)


def test_backward_is_the_adjoint_of_forward(unmodified: tuple[Estimate, Evaluation]) -> None:
    fit, evaluation = unmodified
    wide, null = with_term(fit.structure, fit.values, term("friction.viscous.pitch"))
    a = forcing(evaluation.path, wide, [np.append(null[:-1], 0.02)], [False])
    q = np.random.default_rng(1000).standard_normal((1, len(evaluation.at.row)))
    L, _, _ = backward(evaluation.path, q)
    assert (L[0] * a[0]).sum() == pytest.approx(float((q @ forward(evaluation.path, a).T)[0, 0]))


def test_on_an_unmodified_rig_no_probe_stands_out(unmodified: tuple[Estimate, Evaluation]) -> None:
    fit, evaluation = unmodified
    assert np.abs(screened(fit, evaluation).score(evaluation, prior=True).z).max() < 5.0


def test_a_cable_stiffness_in_yaw_stands_out_with_its_size() -> None:
    fit, evaluation = fitted(rich(1001, "stiffness.cable.yaw:0.05"))
    seen = screened(fit, evaluation).score(evaluation, prior=True)
    best = int(np.argmax(seen.z**2))
    assert seen.probes[best].name == "stiffness.cable.yaw"
    assert seen.amplitude[best] == pytest.approx(0.05, rel=0.2)


def test_a_periodic_torque_is_found_at_its_frequency() -> None:
    fit, evaluation = fitted(rich(1004, "disturbance.periodic.yaw:0.03@0.7"))
    seen = screened(fit, evaluation).score(evaluation, prior=True)
    probe = {p.name: p for p in seen.probes}["disturbance.periodic.yaw"]
    z = dict(zip([p.name for p in seen.probes], seen.z, strict=True))
    assert z["disturbance.periodic.yaw"] > 10
    assert probe.values[1] == pytest.approx(0.7, abs=0.02)
    assert probe.values[0] == pytest.approx(0.03, rel=0.2)


def test_the_rotor_curve_is_a_candidate_only_with_motor_lag() -> None:
    assert "motor.rotor_curve" not in {t.name for t in candidates()}
    assert "motor.rotor_curve" in {t.name for t in candidates(["motor.lag"])}


def test_a_refuted_term_is_no_candidate_and_lets_no_other_effect_in() -> None:
    names = {t.name for t in candidates(refuted=["motor.lag"])}
    assert not names & {"motor.lag", "motor.rotor_curve"}


def test_a_voltage_limit_has_no_size() -> None:
    V = np.linspace(0.0, 12.0, 100).repeat(2).reshape(-1, 2)
    assert {p.size for p in probes(term("motor.saturation"), V)} == {None}


def test_base_parameters_and_existing_terms_are_not_candidates() -> None:
    names = {t.effect.name for t in candidates()}
    assert not names & {"inertia", "mass.imbalance", "motor.thrust_gain"}
    assert "stiffness.cable.yaw" not in {t.name for t in candidates(["stiffness.cable.yaw"])}
