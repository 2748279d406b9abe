"""The likeliest cause is chosen; causes that the recording cannot separate are confounded."""

from __future__ import annotations

from functools import cache
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis.conclusion.adoption import with_positive_torque
from heli3dof.diagnosis.constants import TIE
from heli3dof.diagnosis.search import select
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.select import Choice, are_confounded, certainty
from heli3dof.diagnosis.search.steps import (
    Step,
    fit_with_cause,
    screening_step,
    without,
)
from heli3dof.experiment.plan import Plan, load_plan, step_plan
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.base_fit import LikelihoodWithInertiaPrior, fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import term
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure
from tests.flown import flown

NONE = cast(Any, None)


def step_of(plan: Plan, hide: str, seed: int) -> tuple[Setup, Step]:
    device = f"mock:?speed=max&seed={seed}&hide={hide}"
    setup = Setup((flown(plan, 40.0, device=device, seed=seed),), 0, 4)
    return setup, screening_step(setup, fit_base(setup), 10).chosen(setup, None)


@cache
def coulomb() -> tuple[Setup, Step, Choice]:
    setup, step = step_of(load_plan("rich"), "friction.coulomb.roll:0.05", 1010)
    assert step.choice is not None
    return setup, step, step.choice


def test_dry_friction_is_not_taken_for_viscous() -> None:
    _, _, choice = coulomb()
    assert choice.term.name == "friction.coulomb.roll"
    assert choice.tied_with == ()
    assert choice.confidence > 0.99


def test_an_adopted_cause_leaves_the_candidates_and_can_be_removed_again() -> None:
    setup, step, choice = coulomb()
    fitted = fit_with_cause(setup, step.fit, choice)
    after = screening_step(setup, fitted, 10)
    assert "friction.coulomb.roll" not in after.screen.names
    assert max(z for _, z in after.largest) < step.nulls.threshold
    less = without(fitted, choice.term.name)
    assert less.structure.terms == ()


def test_backlash_in_roll_is_not_compensated_by_its_score_bias() -> None:
    """Without the backlash, the fitted noise is fifty times larger. The bias correction is invalid
    there: it would move T_g to −8 N·m and remove the backlash."""
    backlash = term("encoder.backlash.roll")
    device = "mock:?speed=max&seed=1031&hide=encoder.backlash.roll:1.0"
    flight = flown("rich", 20.0, device=device, seed=1031)
    structure = Structure(flight.profile, (backlash,))
    problem = LikelihoodWithInertiaPrior(data_of([flight], usable_runs(flight, 0)), structure)
    start = problem.structure.scaled(np.array([f.start for f in structure.free[:-1]] + [1.0]))
    fit = maximise_corrected(problem, start, np.array([0.003, 0.014, 0.0025, 0.0]), None)
    bias = np.array([1235.0, -92.0, -148.0, -79.0, -14.0])  # of hidden case rich-pair-40020
    fitted = CorrectedFit(problem, fit, np.eye(5), bias, np.array([692.0, 10.0, -32.0]), 12)
    less = without(fitted, backlash.name)
    assert less.values[0] == pytest.approx(fitted.values[0], rel=0.05)  # T_g
    assert less.optimum.loglik < fitted.optimum.loglik - 100


@pytest.mark.accuracy
def test_a_ground_effect_is_reported_with_its_height() -> None:
    """The bias correction of a candidate is linear, so in this flight its h₀ is far too high. The
    fit that is reported is corrected where it ends."""
    setup, step = step_of(load_plan("steps"), "aero.ground_effect:0.2@0.111", 1043)
    assert step.choice is not None
    scores = {c.term.name: c.score for c in step.choice.candidates}
    assert step.choice.term.name == "aero.ground_effect"
    assert scores["aero.ground_effect"] > scores["stiffness.pendulum.roll"]
    share, height_m = fit_with_cause(setup, step.fit, step.choice).values[-2:]
    assert 0.05 < height_m < 0.3
    assert 0.1 < share < 0.5


@pytest.mark.accuracy
def test_in_a_single_step_a_delay_is_named_or_confounded() -> None:
    _, step = step_of(step_plan((10.0, None, None)), "motor.delay:0.015", 1016)
    assert step.choice is not None
    assert "motor.delay" in {step.choice.term.name, *step.choice.tied_with}


def tied_scores(s: Any, a: Any, b: Any, **options: Any) -> bool:
    """Replace `are_confounded` by a comparison of scores alone."""
    return bool(a.score - b.score < TIE)


@pytest.mark.parametrize(("Z2", "named"), [(29.0, True), (14.3, False)])
def test_a_cause_below_the_screen_threshold_is_not_named(
    monkeypatch: pytest.MonkeyPatch, Z2: float, named: bool
) -> None:
    screened, likeliest = term("motor.saturation"), term("motor.thrust_curve")
    fits = [
        CandidateFit(likeliest, NONE, NONE, 60.0, Z2, 0),
        CandidateFit(screened, NONE, NONE, 8.0, 34.7, 1),
    ]
    monkeypatch.setattr(select, "fit_candidates", lambda *a: fits)
    monkeypatch.setattr(select, "are_confounded", tied_scores)
    nulls = cast(
        Any, SimpleNamespace(threshold=28.2, threshold_of=lambda t: 28.2, confidence=lambda z: 1.0)
    )
    choice = select.choose(
        cast(Any, SimpleNamespace(nulls=nulls, ranked=[(screened, 34.7, 1)])), None
    )
    assert (choice is not None) is named


def test_the_probability_of_a_name_follows_from_its_margin() -> None:
    # Scores are twice a log-likelihood: a margin of 6 is odds of e³ to one.
    assert certainty([26.0, 20.0]) == pytest.approx(np.exp(3) / (1 + np.exp(3)))
    assert certainty([20.0, 20.0]) == 0.5
    assert certainty([20.0]) == 1.0


@pytest.mark.parametrize(
    ("rho", "flights", "scores", "confounded"),
    [
        # Expected difference (1 − ρ²) S = 17, margin max(6, 0.03 · 850) = 25.5.
        (0.99, 64, (850.0, 750.0), True),
        (-0.99, 64, (850.0, 750.0), True),
        (0.9, 64, (850.0, 750.0), False),
        # Margin 12 + 2 √400 √(2 · 0.05)/√B: 13.6 with 64 flights, 16.5 with 8.
        (0.95, 64, (400.0, 385.0), False),
        (0.95, 8, (400.0, 385.0), True),
    ],
)
def test_correlated_causes_and_few_flights_confound(
    rho: float, flights: int, scores: tuple[float, float], confounded: bool
) -> None:
    screen = SimpleNamespace(plain=[NONE, NONE], correlation=lambda a, b: rho)
    nulls = SimpleNamespace(mean=np.zeros(2), inflation=1.0, flights=flights)
    best, other = (CandidateFit(NONE, NONE, NONE, x, 90.0, i) for i, x in enumerate(scores))
    s = cast(Any, SimpleNamespace(screen=screen, nulls=nulls))
    assert are_confounded(s, best, other) is confounded


@pytest.mark.parametrize(("score", "within"), [(385.0, True), (390.0, False)])
def test_a_choice_states_a_tie_within_the_error_of_the_bias_correction(
    score: float, within: bool
) -> None:
    """The margin is 12 without this error, and 16.5 with it."""
    screen = SimpleNamespace(plain=[NONE, NONE], correlation=lambda a, b: 0.95)
    nulls = SimpleNamespace(
        mean=np.zeros(2), inflation=1.0, flights=8,
        threshold=28.2, threshold_of=lambda t: 28.2, confidence=lambda z: 1.0,
    )  # fmt: skip
    fits = [
        CandidateFit(term("motor.delay"), NONE, NONE, 400.0, 90.0, 0),
        CandidateFit(term("motor.lag"), NONE, NONE, score, 80.0, 1),
    ]
    s = cast(Any, SimpleNamespace(screen=screen, nulls=nulls))
    choice = select.best_choice(s, fits, None)
    assert choice is not None
    assert choice.tied_with == ("motor.lag",)
    assert choice.within_bias_error is within


def test_a_periodic_torque_has_a_positive_amplitude() -> None:
    # −τ sin(x) = τ sin(x + π)
    out = with_positive_torque({"torque_Nm": (-0.02, 0.001), "phase_rad": (0.5, 0.1)})
    assert out["torque_Nm"] == (0.02, 0.001)
    assert out["phase_rad"][0] == pytest.approx(0.5 - np.pi)
    assert with_positive_torque({"torque_Nm": (-0.02, 0.001)}) == {"torque_Nm": (-0.02, 0.001)}


@pytest.mark.parametrize(("score", "named"), [(29.0, True), (27.0, False)])
def test_a_screened_cause_is_taken_over_a_likelier_one_below_the_threshold(
    monkeypatch: pytest.MonkeyPatch, score: float, named: bool
) -> None:
    # Measured on doublets with `aero.inflow` 0.11: a periodic torque at its best frequency has the
    # score 68 and Z² 7.5, the true cause 56 and 44.
    fits = [
        CandidateFit(term("disturbance.periodic.roll"), NONE, NONE, 60.0, 7.5, 0),
        CandidateFit(term("aero.inflow"), NONE, NONE, score, 44.0, 1),
        CandidateFit(term("friction.viscous.roll"), NONE, NONE, score - 1.0, 39.0, 2),
    ]
    monkeypatch.setattr(select, "are_confounded", tied_scores)
    nulls = cast(
        Any, SimpleNamespace(threshold=28.2, threshold_of=lambda t: 28.2, confidence=lambda z: 1.0)
    )
    choice = select.best_choice(cast(Any, SimpleNamespace(nulls=nulls)), fits, None)
    assert (choice is not None) is named
    if choice is not None:
        assert choice.term.name == "aero.inflow"
        assert choice.tied_with == ("disturbance.periodic.roll", "friction.viscous.roll")
        assert choice.confidence > 0.99  # the cause is one of the three
