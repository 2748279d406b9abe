"""Effects that a multi-step fit lacks: score test, forward selection, confounded effects."""

from __future__ import annotations

import pytest

from heli3dof.diagnosis.free_run.candidates import (
    possible_replacements,
    score_tests,
    with_further_effects,
)
from heli3dof.diagnosis.free_run.refits import STAGE_S, refit
from heli3dof.diagnosis.search.nulls import bonferroni
from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit, search
from heli3dof.identification.greybox.weak_form import weak_start
from heli3dof.model.effects import term
from tests.identification.known_flights import fly

CABLE, NAMES = "stiffness.cable.yaw", ("stiffness.pendulum.roll", "friction.viscous.yaw")


@pytest.fixture(scope="module")
def lacking() -> MultiStepFit:
    """A fit without the cable that acts in this flight; no list of usual effects has a cable."""
    flight = fly(1022, "rich", hide=f"{CABLE}:0.5", until_s=45.0, rate_hz=500.0)
    problem = problem_of([flight.recording], NAMES)
    return search(problem, weak_start(problem), stages_s=(STAGE_S,))


@pytest.fixture(scope="module")
def complete(lacking: MultiStepFit) -> MultiStepFit:
    return with_further_effects(lacking)


def test_an_effect_that_the_fit_lacks_has_the_largest_score(lacking: MultiStepFit) -> None:
    tests = score_tests(lacking)
    best, second = tests[:2]
    assert best.name == CABLE
    assert best.Z2 > bonferroni(60) > second.Z2
    assert not any(term(c.name).effect.formal for c in tests)


def test_the_score_predicts_the_cost_of_the_refit(lacking: MultiStepFit) -> None:
    """To first order: the cost is robust and the flight is not linear in the stiffness."""
    won = lacking.cost - refit(lacking, "", CABLE).cost
    assert pytest.approx(won, rel=0.15) == score_tests(lacking)[0].Z2


def test_only_the_missing_effect_is_added(complete: MultiStepFit) -> None:
    assert [t.name for t in complete.structure.terms] == [*NAMES, CABLE]
    assert complete.values[-1] == pytest.approx(0.5, rel=0.15)


def test_an_effect_with_nearly_the_same_motion_may_replace_a_cause(
    complete: MultiStepFit,
) -> None:
    tests = score_tests(complete)
    assert "drag.quadratic.yaw" in possible_replacements(complete, "friction.viscous.yaw", tests)
    assert "drag.quadratic.roll" not in possible_replacements(complete, CABLE, tests)
