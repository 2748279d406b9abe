"""The plan that determines what a free-run fit left open; a mock flight of seed 1022."""

from __future__ import annotations

import doctest

import numpy as np
import pytest

from heli3dof.diagnosis import result as results
from heli3dof.diagnosis.free_run.refits import STAGE_S
from heli3dof.diagnosis.planning import free_run_plan as module
from heli3dof.diagnosis.planning.free_run_plan import (
    OpenParameter,
    coupling,
    next_free_flight,
    open_parameters,
)
from heli3dof.diagnosis.result import NextExperiment, PlanForecast, UndecidedTerms
from heli3dof.identification.greybox.freeflight import model_of, problem_of
from heli3dof.identification.greybox.multistep import search
from heli3dof.identification.greybox.weak_form import weak_start
from tests.identification.known_flights import fly

NAMES = ("friction.viscous.yaw", "motor.lag", "encoder.offset.pitch")


@pytest.fixture(scope="module")
def open_() -> UndecidedTerms:
    """A flight with little yaw motion; yaw's viscous friction is left open."""
    recording = fly(1022, until_s=40.0).recording.between(0, 25)
    problem = problem_of([recording], NAMES)
    fit = search(problem, weak_start(problem), stages_s=(STAGE_S,), rounds=2)
    return UndecidedTerms(fit, ("friction.viscous.yaw",))


def flight_for(open_: UndecidedTerms, *plans: str) -> NextExperiment | None:
    return next_free_flight(open_, model_of(open_.fit, [], "rig"), plans=plans)


def test_the_doctests_pass() -> None:
    assert doctest.testmod(module, extraglobs={"np": np}).failed == 0
    assert doctest.testmod(results).failed == 0


def test_a_flight_that_turns_determines_yaw_s_friction(open_: UndecidedTerms) -> None:
    result = flight_for(open_, "ring-down", "coast-down")
    assert result is not None
    assert result.plan == "coast-down"
    assert result.separates == ("friction.viscous.yaw",)
    margin = {o.plan: o.margin for o in result.ranking}
    assert margin["coast-down"] > 10 * margin["ring-down"]
    assert "friction.viscous.yaw" in result.why


def test_no_plan_is_proposed_if_nothing_or_only_offsets_per_recording_are_open(
    open_: UndecidedTerms,
) -> None:
    for names in ((), ("encoder.offset.pitch",)):
        assert flight_for(UndecidedTerms(open_.fit, names), "steps") is None


def test_confounded_terms_are_planned_for_together_by_those_with_an_absence(
    open_: UndecidedTerms,
) -> None:
    confounded = UndecidedTerms(open_.fit, ("friction.viscous.yaw", "motor.lag"), tied=True)
    assert [w.name for w in open_parameters(confounded)] == ["friction.viscous.yaw"]
    result = flight_for(confounded, "coast-down")
    assert result is not None
    assert result.separates == ("friction.viscous.yaw", "motor.lag")
    assert "these causes are confounded" in result.why


def test_the_reason_gives_each_size_with_the_probability_to_find_it() -> None:
    parameters = [
        OpenParameter("stiffness.pendulum.roll", 0, 2.5, 0.1, 1.0, "N·m"),
        OpenParameter("aero.ground_effect", 1, 0.28, 0.1, 1.0, "–"),
    ]
    best = PlanForecast("doublets", 40.0, (25.0, 1.0), 0.58)
    assert module._why(best, parameters, tied=False).endswith(
        "40 s of this plan find stiffness.pendulum.roll with a probability of > 99 % (if its size "
        "is 2.5 N·m), aero.ground_effect with a probability of 17 % (if its size is 0.28)"
    )


def test_a_plan_that_hardly_decides_states_how_often_to_fly_it() -> None:
    """u = 1.8: one flight finds the term with a probability of 44 %, four with 95 %."""
    yaw = OpenParameter("friction.viscous.yaw", 0, 0.1, 0.1, 1.0, "N·m·s/rad")
    why = module._why(PlanForecast("large", 70.0, (1.8**2,), 0.44), [yaw], tied=False)
    assert "4 such flights decide with a probability of 90 %. Or measure" in why


def test_half_the_deviation_is_three_times_the_information_in_addition() -> None:
    """u² = θ² (4/σ² − 1/σ²): with θ = σ, u² = 3; no new information gives 0."""
    w = OpenParameter("friction.viscous.yaw", 0, 0.1, 0.1, 1.0, "N·m·s/rad")
    assert w.expected_chi2(0.05) == pytest.approx(3)
    assert w.expected_chi2(0.1) == 0.0


def test_the_link_between_own_values_leaves_their_common_mean_free(open_: UndecidedTerms) -> None:
    """A common shift of the mean and of an own value costs nothing, however wide the prior."""
    p = open_.fit.problem
    L = coupling(p)
    shift = np.zeros(p.dim)
    shift[[p.own[0], p.n]] = 1.0
    assert shift @ L @ shift == pytest.approx(0.0, abs=1e-9)
    assert L[p.n, p.n] > 0
