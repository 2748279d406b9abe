"""The bias-corrected fit with a cause: its noise on a limit cycle, and its second start."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.screening.grid_trials import widened
from heli3dof.diagnosis.selection.steps import bias_corrected
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.closed_loop_fit.base_fit import fit_base
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.model.effects import term
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.profile import default_profile
from tests.flown import flown

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
    problem = widened(base.problem, term("stiffness.pendulum.roll"))
    noise = base.optimum.noise
    start = maximise_corrected(problem, np.append(base.theta, 0.0), noise, None)
    fit = bias_corrected(setup, problem, start)
    assert fit.values[1] == pytest.approx(truth, rel=0.06)
    assert fit.optimum.noise[0] < 0.4 * noise[0]


@pytest.mark.accuracy
def test_a_delay_is_found_although_its_full_fit_cannot_be_simulated() -> None:
    """The full fit has a tenth of the yaw inertia. The correction starts again without that."""
    device = "mock:?speed=max&noise=0.3&hide=motor.delay:0.05"
    flight = fly_plan(step_plan((10.0, None, None)), device=device, seed=2952).recording
    (cause,) = diagnose(flight).findings
    assert cause.term.name == "motor.delay"
    delay_s, std = cause.values["delay_s"]
    assert abs(delay_s - 0.05) < 3 * std
