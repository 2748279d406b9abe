"""A fit that a limit cycle has biased is corrected; other fits stay as they are."""

from __future__ import annotations

from dataclasses import replace

import pytest

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.bias_correction.identify_correction import (
    MAX_INFLATION,
    correction_note,
    without_bias,
)
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.recording.recording import Recording
from tests.flown import flown

J_ROLL = 0.914455
"""kg·m² of the emulated rig: its masses and lengths are those of the paper's Table I"""


@pytest.fixture(scope="module")
def step() -> Recording:
    plan = step_plan((10.0, None, None))
    return fly_plan(plan, device="mock:?speed=max", seed=33).recording


@pytest.fixture(scope="module")
def plain(step: Recording) -> Estimate:
    return fit_greybox(step)


def error(fit: Estimate) -> float:
    """The roll inertia's error in standard deviations."""
    (j,) = (j for j, f in enumerate(fit.free) if f.name == "J_roll")
    return float((fit.values[j] - J_ROLL) / fit.std[j])


def test_the_roll_inertia_of_a_step_is_no_longer_far_too_small(
    step: Recording, plain: Estimate
) -> None:
    corrected = without_bias(plain, [step])
    assert isinstance(corrected, CorrectedFit)
    assert error(plain) < -5
    assert abs(error(corrected)) < 3
    assert "8 simulated flights of the fitted rig" in correction_note(corrected)[0]
    assert correction_note(plain) == []


def test_without_a_known_controller_a_fit_stays_as_it_is(step: Recording, plain: Estimate) -> None:
    profile = step.profile.model_copy(update={"controller": None})
    assert without_bias(plain, [replace(step, profile=profile)]) is plain


def test_a_fit_with_a_valid_likelihood_stays_as_it_is() -> None:
    rich = flown("rich", 30.0, device="mock:?speed=max", seed=31)
    fit = fit_greybox(rich)
    assert fit.inflation <= MAX_INFLATION
    assert without_bias(fit, [rich]) is fit
