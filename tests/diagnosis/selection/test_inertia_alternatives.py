"""An inertia that absorbed a slow torque returns to nominal in a full fit; a wrong one stays."""

from __future__ import annotations

from functools import cache

import pytest

from heli3dof.diagnosis.base_parameters import off_nominal
from heli3dof.diagnosis.conclusion.inertia_ties import with_confounded_causes
from heli3dof.diagnosis.selection.inertia_alternatives import instead_of_inertia, within
from heli3dof.diagnosis.selection.steps import Step, screening_step
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup

SLOW = "disturbance.periodic.roll:0.12@0.366"
HEAVY = "inertia.roll:1.6"


@cache
def first_step(hide: str, seed: int) -> tuple[Setup, Step]:
    """Return the screen of a 10° step in roll."""
    device = f"mock:?speed=max&seed={seed}&hide={hide}"
    flown = fly_plan(step_plan((10.0, None, None)), device=device, seed=seed).recording
    setup = Setup((flown,), seed, 6)
    return setup, screening_step(setup, fit_base(setup), 16)


@pytest.mark.accuracy
@pytest.mark.parametrize("hide", [SLOW, HEAVY])
def test_a_slow_torque_and_a_wrong_inertia_both_move_the_roll_inertia(hide: str) -> None:
    _, step = first_step(hide, 1202)
    off = off_nominal(step.fit)
    assert [o.term.name for o in off] == ["inertia.roll"]


def test_no_effect_restores_an_inertia_that_is_truly_off() -> None:
    _, step = first_step(HEAVY, 1202)
    assert instead_of_inertia(step) == []


@pytest.mark.accuracy
def test_a_slow_torque_is_confounded_with_the_inertia_that_absorbed_it() -> None:
    _, step = first_step(SLOW, 1202)
    assert step.largest[0][1] < step.nulls.threshold
    best = instead_of_inertia(step)[0]
    torque, frequency = best.problem.values(best.optimum.theta)[-3:-1]
    assert torque == pytest.approx(0.12, abs=0.012)
    assert frequency == pytest.approx(0.366, abs=0.003)
    (off,) = off_nominal(step.fit)
    (tied,) = with_confounded_causes([off], step)
    assert "disturbance.periodic.roll" in tied.tied_with


def test_only_the_requested_parameter_counts() -> None:
    _, step = first_step(HEAVY, 1202)
    assert not within(step.fit, {"inertia.roll"})
    assert within(step.fit, {"inertia.yaw"})
