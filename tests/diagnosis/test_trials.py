"""Play of an encoder: worth a fit where it is, never where it is not, and found at its size."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from heli3dof.axes import AXES
from heli3dof.diagnosis.base_fit import base_of
from heli3dof.diagnosis.corrected import Informed
from heli3dof.diagnosis.steps import Bench, extended, looked_at
from heli3dof.diagnosis.tilted import maximise_tilted
from heli3dof.diagnosis.trials import beginning, ringing, trials, tried_terms, widened
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.physics.parametrisation import Structure


@cache
def base(hide: str, seed: int) -> Estimate:
    """The base simulation, which knows of no play, fitted to half a minute."""
    url = f"mock:?speed=max&seed={seed}&hide={hide}"
    r = fly_plan(load_plan("rich"), device=url, seed=seed).recording.between(0.0, 30.0)
    return estimate(Informed(data_of([r], usable_runs(r, 0)), Structure(r.profile, ())))


def suspected(found: Estimate) -> list[str]:
    o = found.optimum
    return [t.term.name for t in trials(found.problem, o.theta, o.noise, tried_terms((), AXES))]


def test_what_has_to_be_tried_is_what_no_screen_sees() -> None:
    names = [t.name for t in tried_terms(["encoder.backlash.roll"], ("roll", "pitch"))]
    assert names == ["encoder.backlash.pitch"]


def test_play_is_suspected_on_its_own_axis_only() -> None:
    assert suspected(base("encoder.backlash.pitch:0.4", 1150)) == ["encoder.backlash.pitch"]


@pytest.mark.parametrize("hide", ["", "friction.coulomb.pitch:0.012"])
def test_where_there_is_none_none_is_suspected(hide: str) -> None:
    assert suspected(base(hide, 1151)) == []


def test_a_fit_that_begins_there_finds_its_width() -> None:
    found = base("encoder.backlash.pitch:0.4", 1150)
    o = found.optimum
    term = tried_terms((), ("pitch",))[0]
    ext = widened(found.problem, o.theta, term)
    start, noise = beginning(ext, o.theta, o.noise, term)
    assert noise[1] < 0.3 * o.noise[1]  # what was put down to random torques
    fit = maximise_tilted(ext, start, noise, None)
    assert ext.values(fit.theta)[-1] == pytest.approx(0.4, abs=0.03)
    assert np.isfinite(fit.loglik)


def test_a_loop_that_rings_with_a_lag_is_not_put_down_to_noise() -> None:
    """With a torque beside it the base doubles J_pitch under four times the noise, and slopes may
    point at nothing; here a threshold above them all stands for that. The lag shows once tried."""
    device = "mock:?speed=max&seed=1043&hide=motor.lag:0.08,bias.torque.pitch:0.025"
    flight = fly_plan(load_plan("rich"), device=device, seed=1043).recording.between(0.0, 40.0)
    bench = Bench((flight,), 0, 4)
    step = looked_at(bench, base_of(bench), 10)
    above = 1.01 * max(z for _, z in step.largest)
    choice = replace(step, nulls=replace(step.nulls, threshold=above)).chosen(bench, None).choice
    assert choice is not None
    assert choice.term.name == "motor.lag"
    found = extended(bench, choice)
    assert found.values[-1] == pytest.approx(0.08, rel=0.1)


def test_without_a_lag_none_wins_by_being_tried() -> None:
    found = base("", 1151)
    o = found.optimum
    assert trials(found.problem, o.theta, o.noise, ringing(())) == []
