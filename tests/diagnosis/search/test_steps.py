"""The fit with a cause on a limit cycle, its second start, refuted candidates, partial rivals."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from heli3dof.diagnosis import diagnose as diagnose_module
from heli3dof.diagnosis.constants import MAX_CAUSES, TIE
from heli3dof.diagnosis.diagnose import FULL, diagnose, forward_selection
from heli3dof.diagnosis.search import select
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.search.steps import Step, bias_corrected, with_rivals_that_remain
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.effects import term
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import default_profile
from heli3dof.stage_clock import StageClock
from tests.flown import flown
from tests.hidden.rig_cases import draw_on_other_rig

NONE = cast(Any, None)
NULLS: Any = SimpleNamespace(
    threshold=20.6, threshold_of=lambda t: 20.6, confidence=lambda Z2: 1.0
)  # fmt: skip
RIG = "mock:?speed=max&spread=0.07&seed=104167411&hide=stiffness.pendulum.roll:0.4"


@pytest.mark.accuracy
def test_with_its_cause_a_fit_on_a_limit_cycle_has_the_rig_s_roll_inertia() -> None:
    """The base's noise contains the pendulum's torque. Held, it lowers the inertia by a fifth."""
    driver = open_driver(RIG, default_profile())
    body = driver.truth.body  # type: ignore[attr-defined]
    driver.close()
    truth = float((body.J[0] + body.dJ[0]) * default_profile().motor.K_f / body.K_f)
    setup = Setup((flown("steps", 90.0, device=RIG, seed=2901),), seed=0, flights_per_round=12)
    base = fit_base(setup)
    problem = base.problem.with_term(term("stiffness.pendulum.roll"))
    noise = base.optimum.noise
    start = maximise_corrected(problem, np.append(base.theta, 0.0), noise, None)
    fit = bias_corrected(setup, problem, start)
    assert fit.values[1] == pytest.approx(truth, rel=0.06)
    assert fit.optimum.noise[0] < 0.4 * noise[0]


@pytest.mark.accuracy
def test_a_delay_is_found_although_its_full_fit_cannot_be_simulated() -> None:
    """The full fit has a tenth of the yaw inertia. The correction starts again without that."""
    device = "mock:?speed=max&noise=0.3&hide=motor.delay:0.05"
    flight = flown(step_plan((10.0, None, None)), device=device, seed=2952)
    (cause,) = diagnose(flight).findings
    assert cause.term.name == "motor.delay"
    delay_s, std = cause.values["delay_s"]
    assert abs(delay_s - 0.05) < 3 * std


def step_of(*candidates: tuple[str, float, float], remaining: dict[str, float]) -> Step:
    """A step whose candidates (name, score, Z²) are given, the chosen one first, and all Z²."""
    fits = tuple(CandidateFit(term(n), NONE, NONE, score, Z2, 0) for n, score, Z2 in candidates)
    best = fits[0] if fits else None
    choice = best and Choice(best.term, best.score, 1.0, (), fits, NULLS.threshold)
    step = Step(NONE, NONE, NONE, NULLS, NONE, choice)
    vars(step)["ranked"] = [(term(n), Z2, 0) for n, Z2 in remaining.items()]
    return step


@pytest.mark.parametrize(
    ("flies", "stage"),
    [(True, "Screening against 64 null simulations …"), (False, "Screening every candidate …")],
)
def test_a_stage_names_null_simulations_only_if_they_are_flown(
    monkeypatch: pytest.MonkeyPatch, flies: bool, stage: str
) -> None:
    """A known controller does not suffice: flights simulated from the fit may diverge."""
    empty = step_of(remaining={})
    step = SimpleNamespace(chosen=lambda *_: empty)
    monkeypatch.setattr(diagnose_module, "off_nominal", lambda fit: ())
    monkeypatch.setattr(diagnose_module, "screening_step", lambda *_: step)
    said: list[str] = []
    setup, fit = SimpleNamespace(controller_is_known=True), SimpleNamespace(is_corrected=flies)
    forward_selection(cast(Any, setup), cast(Any, fit), (), FULL, StageClock(said.append))
    assert said[0] == stage


def test_no_cause_is_searched_beyond_the_largest_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagnose_module, "off_nominal", lambda fit: ())
    earlier = [SimpleNamespace(score=30.0, candidates=[SimpleNamespace(probe=1)])] * MAX_CAUSES
    fit: Any = SimpleNamespace()
    found = forward_selection(
        cast(Any, None), fit, cast(Any, earlier), FULL, StageClock(lambda _: None)
    )
    assert found == ([], fit)


def tied_scores(s: Any, a: Any, b: Any, **options: Any) -> bool:
    """Replace `are_confounded` by a comparison of scores alone."""
    return bool(a.score - b.score < TIE)


def test_a_candidate_that_cannot_be_simulated_is_confounded_with_the_next_best(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(select, "are_confounded", tied_scores)
    pitch, roll = "friction.coulomb.pitch", "friction.coulomb.roll"
    step = step_of((pitch, 3982.0, 773.0), (roll, 1985.0, 193.0), remaining={})
    following = step.next_choice([pitch], None).choice
    assert following is not None
    assert (following.term.name, following.tied_with) == (roll, (pitch,))
    assert step.next_choice([pitch, roll], None).choice is None


def test_a_rival_that_its_cause_explains_only_in_part_is_confounded_with_it() -> None:
    """Numbers of rigs-single 3156: quadratic drag is hidden; the periodic torque is a vibration."""
    first = step_of(
        ("friction.viscous.roll", 252.6, 102.9), ("drag.quadratic.roll", 219.9, 110.1),
        ("disturbance.periodic.pitch", 20.3, 28.7), remaining={},
    )  # fmt: skip
    rest = {"drag.quadratic.roll": 33.4, "disturbance.periodic.pitch": 29.1}
    (step, _) = with_rivals_that_remain([first, step_of(remaining=rest)])
    assert step.choice is not None
    assert step.choice.tied_with == ("drag.quadratic.roll",)
    explained = {"drag.quadratic.roll": 3.0}
    (step, _) = with_rivals_that_remain([first, step_of(remaining=explained)])
    assert step.choice is not None
    assert step.choice.tied_with == ()


def test_a_rival_that_only_a_formula_error_leaves_significant_is_not_confounded() -> None:
    """An added mass of 0.1 kg, the plan ``rich``: 3 % of its score is more than what remains."""
    first = step_of(
        ("mass.change", 2712.0, 900.0), ("motor.supply_sag", 1130.0, 700.0), remaining={}
    )
    (step, _) = with_rivals_that_remain([first, step_of(remaining={"motor.supply_sag": 40.0})])
    assert step.choice is not None
    assert step.choice.tied_with == ()


@pytest.mark.accuracy
@pytest.mark.parametrize("seed", [3103, 3112])
def test_both_causes_are_found_though_one_conceals_the_other(seed: int) -> None:
    """3103: friction drives a ground effect's share to its bound. 3112: with only one of two
    frictions in the model, simulated flights diverge."""
    case = draw_on_other_rig("rigs-pair", seed)
    flight = case.fly()
    assert not isinstance(flight, str)
    found = {f.term.name for f in diagnose(flight).findings}
    assert found == {h.name for h in case.hidden}
