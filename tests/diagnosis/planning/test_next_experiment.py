"""The recommended plan separates the confounded causes. Seeds from 1230."""

from __future__ import annotations

import doctest
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heli3dof.diagnosis.constants import TIE
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.diagnosis.planning import next_experiment as module
from heli3dof.diagnosis.planning import plan_flights
from heli3dof.diagnosis.planning.next_experiment import next_experiment, recommend, typical_cause
from heli3dof.diagnosis.result import DOES_NOT_PAY, Diagnosis, Dropped, NextExperiment, PlanForecast
from heli3dof.diagnosis.search.candidate_fits import CandidateFit
from heli3dof.diagnosis.search.catalogue import Probe, candidates
from heli3dof.diagnosis.search.select import Choice
from heli3dof.diagnosis.unmodelled.unmodelled_torque import ResidualTorque
from heli3dof.errors import UsageError
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import term
from tests.flown import flown
from tests.profiles import profile


@pytest.fixture(scope="module")
def base() -> Estimate:
    """Base fit to 30 s of the steps plan at 250 Hz. Its model lacks the rig's Coulomb friction."""
    device = "mock:?speed=max&start=level&hide=friction.coulomb.yaw:0.03"
    recording = flown("steps", 30.0, device=device, seed=1231, profile=profile(rate_hz=250.0))
    return fit_base(Setup((recording,), seed=0, flights_per_round=2))


def test_the_doctests_pass() -> None:
    assert doctest.testmod(module).failed == 0
    assert doctest.testmod(plan_flights).failed == 0


def test_a_typical_cause_has_an_effect() -> None:
    assert typical_cause("friction.coulomb.yaw").values == (0.02,)
    assert typical_cause("motor.dead_zone").values == (0.3,)  # where its fit starts
    for t in candidates():
        first = t.effect.parameters[0]
        assert typical_cause(t.name).values[0] != first.null, t.name


@pytest.mark.accuracy
def test_a_flight_with_yaw_motion_separates_the_frictions(base: Estimate) -> None:
    names = ["friction.coulomb.yaw", "friction.viscous.yaw"]
    result = recommend(base, [typical_cause(n) for n in names], plans=["prbs", "coast-down"])
    assert result.plan == "coast-down"
    assert result.separates == tuple(names)
    assert result.certainty is not None
    assert result.certainty > 0.9
    assert all(n in result.why for n in names)
    margins = {o.plan: o.margin for o in result.ranking}
    assert margins["coast-down"] > 10 * margins["prbs"]


def test_a_slow_ramp_separates_lag_from_delay_less_than_large_steps(base: Estimate) -> None:
    causes = [typical_cause("motor.lag"), typical_cause("motor.delay")]
    result = recommend(base, causes, plans=["ramp", "large"])
    assert result.plan == "large"
    margins = {o.plan: o.margin for o in result.ranking}
    # A margin m of one flight scatters by 2 √m: the two differ by more than twice that.
    assert margins["large"] - margins["ramp"] > 4 * math.sqrt(max(margins["ramp"], 1.0))
    per_second = [o.margin / o.duration_s for o in result.ranking]
    assert per_second == sorted(per_second, reverse=True)
    # Neither the other plans nor another run change a plan's forecast.
    (alone,) = recommend(base, causes, plans=["large"]).ranking
    assert alone in result.ranking


def test_a_single_cause_is_compared_with_its_absence(base: Estimate) -> None:
    result = recommend(base, [typical_cause("stiffness.pendulum.roll")], plans=["levels", "chirp"])
    assert result.plan == "levels"  # roll far from level, where a pendulum pulls
    assert "stiffness.pendulum.roll" in result.why


def diagnosed(base: Estimate, *dropped: Dropped) -> Diagnosis:
    """No finding except dropped causes; the listed effects were not identifiable."""
    fitted = SimpleNamespace(base=base, open=None)
    invisible = ("encoder.scale.yaw", "friction.viscous.yaw", "drag.quadratic.roll")
    return Diagnosis(
        ("r",), (), "nothing_found", (), fitted, dropped=dropped, not_identifiable=invisible
    )  # type: ignore[arg-type]


def test_a_dropped_cause_is_planned_for_at_its_estimated_size(
    base: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    requested: list[list[Probe]] = []

    def recommend(base: Estimate, causes: list[Probe], **options: Any) -> NextExperiment:
        requested.append(causes)
        return NextExperiment("rich", tuple(c.term.name for c in causes), "", 0.9)

    monkeypatch.setattr(module, "recommend", recommend)
    lag = term("motor.lag")
    structure = base.structure.with_terms(lag)
    problem = replace(base.problem, structure=structure)
    theta = problem.structure.scaled(np.append(base.values, 0.013))
    candidate = CandidateFit(lag, problem, replace(base.optimum, theta=theta), 9.0, 20.0, None)
    choice = Choice(lag, 9.0, 0.9, (), (candidate,))
    dropped = next_experiment(diagnosed(base, Dropped("motor.lag", None, choice=choice)))  # type: ignore[arg-type]
    next_experiment(diagnosed(base, Dropped("motor.lag", None)))  # type: ignore[arg-type]
    hidden = next_experiment(diagnosed(base))
    assert dropped is not None
    assert dropped.why.endswith(", which fits these recordings better, but " + DOES_NOT_PAY)
    assert hidden is not None
    assert hidden.why.endswith(", which these recordings cannot show, even if it is large")
    estimated, typical, invisible = (causes[0] for causes in requested)
    assert estimated.values == pytest.approx((0.013,))
    assert typical == typical_cause("motor.lag")
    assert invisible == typical_cause("friction.viscous.yaw")
    assert all(len(causes) == 1 for causes in requested)


def test_no_flight_is_recommended_if_not_even_many_decide() -> None:
    best = PlanForecast("levels", 66.0, (-0.4, 1.0), 0.1, (50.0, 50.0))
    upcoming = module._recommended((best,), ("encoder.offset.pitch", "aero.reaction_torque"))
    assert upcoming.plan is None
    document = diagnosis_document(Diagnosis(("r",), (), "ambiguous", ()), None, upcoming)
    assert document["next_experiment"] is None
    assert document["about"]["no_next_experiment"] == (
        "no plan separates encoder.offset.pitch and aero.reaction_torque: not even 20 flights of "
        "the best one, levels, decide with a probability of 90 %. Measure one effect by hand"
    )


def test_an_effect_that_a_residual_torque_resembles_is_planned_for(
    base: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    requested: list[Probe] = []

    def recommend(base: Estimate, causes: list[Probe], **options: Any) -> NextExperiment:
        requested.extend(causes)
        return NextExperiment("coast-down", ("friction.coulomb.yaw",), "sure", 0.9, ())

    monkeypatch.setattr(module, "recommend", recommend)
    like = ResidualTorque(
        "yaw", "yaw_rate", 0.3, (), (), 30.0, 0.99, (), "friction.coulomb.yaw-like"
    )
    found = replace(diagnosed(base), residual_torques=(like,))
    result = next_experiment(found)
    assert result is not None
    assert result.why == "sure, which would explain the residual torque of these recordings"
    (probe,) = requested
    assert probe.term.name == "friction.coulomb.yaw"
    assert probe.values == pytest.approx((0.03,), rel=0.2)  # the rig's
    unlike = replace(like, resembles=None)
    assert replace(found, residual_torques=(like, unlike)).likely_effects == ()


LAG_OR_DELAY = ("motor.lag", "motor.delay")


def forecast(*margins: float, scores: tuple[float, ...]) -> PlanForecast:
    f = PlanForecast("rich", 60.0, margins, 0.0, scores)
    return replace(f, certainty=module._certainty(f, TIE))


def test_a_plan_that_hardly_decides_is_introduced_by_that() -> None:
    best = forecast(5.0, 9.0, scores=(20.0, 20.0))
    assert module._recommended((best,), LAG_OR_DELAY).why.startswith(
        "no plan separates motor.lag and motor.delay well. In simulation, 60 s of this plan do so "
        "by a margin of 5, more than any other plan. 12 such flights decide"
    )
    clear = forecast(90.0, 120.0, scores=(200.0, 200.0))
    assert "no plan" not in module._recommended((clear,), LAG_OR_DELAY).why


def test_a_plan_that_shows_only_one_of_two_causes_is_not_certain() -> None:
    f = forecast(35.5, 0.33, scores=(60.0, 60.0))
    assert f.certainty < 0.05
    assert module._recommended((f,), LAG_OR_DELAY).plan is None


def test_a_margin_within_the_error_of_formulas_never_decides() -> None:
    assert module._probability_decided(60.0, 5000.0, 20) < 0.1


def test_a_chirp_separates_a_lag_from_a_delay_whichever_the_rig_has(base: Estimate) -> None:
    """At high frequencies, a score test linearised without the cause favours the wrong one."""
    t = [Probe(term("motor.lag"), (0.03,)), Probe(term("motor.delay"), (0.024,))]
    (chirp,) = recommend(base, t, plans=["chirp"]).ranking
    assert min(chirp.margins) > 100.0


def test_an_error_is_raised_if_no_plan_can_be_flown(base: Estimate) -> None:
    with pytest.raises(UsageError, match="No plan separates"):
        recommend(base, [typical_cause("motor.lag")], plans=[])
