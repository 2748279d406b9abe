"""The plan that is recommended is the one that parts the tied causes; seeds from 1230."""

from __future__ import annotations

import doctest
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from heli3dof.diagnosis import next_experiment as module
from heli3dof.diagnosis.base_fit import base_of
from heli3dof.diagnosis.contenders import Contender
from heli3dof.diagnosis.next_experiment import Cause, next_experiment, recommend
from heli3dof.diagnosis.outlook import NextExperiment
from heli3dof.diagnosis.result import Diagnosis, Dropped
from heli3dof.diagnosis.select import Choice
from heli3dof.diagnosis.steps import Bench
from heli3dof.errors import UsageError
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.model.effects import term
from heli3dof.model.physics.parametrisation import Structure


@pytest.fixture(scope="module")
def base() -> Estimate:
    """A base fit from steps, on a rig with Coulomb friction that it knows nothing of."""
    device = "mock:?speed=max&start=level&hide=friction.coulomb.yaw:0.03"
    flown = fly_plan(load_plan("steps"), device=device, seed=1231).recording
    return base_of(Bench((flown,), seed=0, pilots=2))


def test_the_doctests() -> None:
    assert doctest.testmod(module).failed == 0


def test_frictions_are_parted_by_a_flight_in_which_yaw_moves(base: Estimate) -> None:
    names = ["friction.coulomb.yaw", "friction.viscous.yaw"]
    found = recommend(base, [Cause.typical(n) for n in names], plans=["prbs", "coast-down"])
    assert found.plan == "coast-down"
    assert found.separates == tuple(names)
    assert found.certainty is not None
    assert found.certainty > 0.9
    assert all(n in found.why for n in names)
    margins = {o.plan: o.margin for o in found.ranking}
    assert margins["coast-down"] > 10 * margins["prbs"]


def test_a_slow_ramp_parts_a_lag_from_a_delay_worse_than_large_steps(base: Estimate) -> None:
    causes = [Cause.typical("motor.lag"), Cause.typical("motor.delay")]
    found = recommend(base, causes, plans=["ramp", "large"])
    assert found.plan == "large"
    margins = {o.plan: o.margin for o in found.ranking}
    # A margin m of one flight scatters by 2 √m: the two differ by more than twice that.
    assert margins["large"] - margins["ramp"] > 4 * math.sqrt(max(margins["ramp"], 1.0))


def test_a_single_cause_is_held_against_nothing(base: Estimate) -> None:
    found = recommend(base, [Cause.typical("stiffness.pendulum.roll")], plans=["levels", "chirp"])
    assert found.plan == "levels"  # roll far from level, where a pendulum pulls
    assert "stiffness.pendulum.roll" in found.why


def test_the_same_seed_recommends_the_same(base: Estimate) -> None:
    lag = [Cause.typical("motor.lag")]
    one, two = (recommend(base, lag, plans=["prbs"], seed=4) for _ in range(2))
    assert one == two


def test_leaving_out_what_cannot_win_changes_neither_the_plan_nor_its_forecast(
    base: Estimate,
) -> None:
    causes = [Cause.typical(n) for n in ("motor.lag", "motor.delay", "motor.dead_zone")]
    plans = ["ramp", "steps", "large", "doublets"]
    together = recommend(base, causes, plans=plans)
    alone = [recommend(base, causes, plans=[p]).ranking[0] for p in plans]
    best = max(alone, key=lambda o: o.margin / o.duration_s)
    assert together.ranking[0] == best
    # Every other one promises less, whether it was flown on all three truths or on one.
    for outlook in together.ranking[1:]:
        assert outlook.margin / outlook.duration_s < best.margin / best.duration_s
    assert sum(len(o.margins) for o in together.ranking) < 3 * len(plans)


def diagnosed(base: Estimate, *dropped: Dropped) -> Diagnosis:
    """Nothing found, but for what did not pay; two effects could not have been seen."""
    fitted = SimpleNamespace(base=base, open=None)
    dark = ("encoder.scale.yaw", "friction.viscous.yaw", "drag.quadratic.roll")
    return Diagnosis(
        ("r",), (), "nothing_found", (), fitted, dropped=dropped, not_identifiable=dark
    )  # type: ignore[arg-type]


def test_what_did_not_pay_is_looked_for_at_its_own_size(
    base: Estimate, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[list[Cause]] = []

    def recommend(base: Estimate, causes: list[Cause], **options: Any) -> NextExperiment:
        asked.append(causes)
        return NextExperiment("rich", tuple(c.term.name for c in causes), "", 0.9)

    monkeypatch.setattr(module, "recommend", recommend)
    lag = term("motor.lag")
    structure = Structure(base.structure.profile, (*base.structure.terms, lag))
    problem = replace(base.problem, structure=structure)
    theta = problem.coordinates(np.append(base.values, 0.013))
    contender = Contender(lag, problem, replace(base.optimum, theta=theta), 9.0, 20.0, None)
    choice = Choice(lag, 9.0, 20.0, 0.9, (), (contender,))
    next_experiment(diagnosed(base, Dropped("motor.lag", None, choice=choice)))  # type: ignore[arg-type]
    next_experiment(diagnosed(base, Dropped("motor.lag", None)))  # type: ignore[arg-type]
    next_experiment(diagnosed(base))
    told, typical, dark = (causes[0] for causes in asked)
    assert told.values == pytest.approx((0.013,))
    assert typical == Cause.typical("motor.lag")
    assert dark == Cause.typical("friction.viscous.yaw")
    assert all(len(causes) == 1 for causes in asked)


def test_where_no_plan_can_be_flown_it_is_said(base: Estimate) -> None:
    with pytest.raises(UsageError, match="No plan can be flown"):
        recommend(base, [Cause.typical("motor.lag")], plans=[])
