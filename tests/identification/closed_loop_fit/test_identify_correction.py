"""The bias of a fit is corrected if the controller is known; other fits stay as they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.experiment.plan import step_plan
from heli3dof.identification.bias_correction.correction import CorrectedFit
from heli3dof.identification.closed_loop_fit.identify_correction import (
    correction_note,
    without_bias,
)
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.method import fit_greybox
from heli3dof.recording.load import load
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import load_profile
from tests.flown import flown
from tests.paths import REAL_DATA, needs_real_data
from tests.profiles import profile

J_ROLL = 0.914455
"""kg·m² of the emulated rig: its masses and lengths are those of the paper's Table I"""


@pytest.fixture(scope="module")
def step() -> Recording:
    plan = step_plan((10.0, None, None), duration_s=26.0)
    return flown(plan, device="mock:?speed=max", seed=33, profile=profile(rate_hz=250.0))


@pytest.fixture(scope="module")
def plain(step: Recording) -> Estimate:
    return fit_greybox(step)


@pytest.fixture(scope="module")
def corrected(step: Recording, plain: Estimate) -> Estimate:
    return without_bias(plain, [step])


def error(fit: Estimate) -> float:
    """The roll inertia's error in standard deviations."""
    (j,) = (j for j, f in enumerate(fit.free) if f.name == "J_roll")
    return float((fit.values[j] - J_ROLL) / fit.std[j])


def test_the_roll_inertia_of_a_step_is_no_longer_far_too_small(
    plain: Estimate, corrected: Estimate
) -> None:
    assert isinstance(corrected, CorrectedFit)
    assert error(plain) < -5
    assert abs(error(corrected)) < 3
    assert "8 simulated flights of the fitted rig" in correction_note(corrected)[0]
    assert correction_note(plain) == []


@pytest.mark.accuracy
@needs_real_data
def test_on_an_extreme_limit_cycle_the_roll_inertia_is_the_rigs() -> None:
    """Plant 2's is the profile's within 7 %; the likelihood alone gives 0.13 of it."""
    folder = REAL_DATA / "plant-2" / "st-c002"
    recording = load(folder / "rec.csv.gz", load_profile(folder / "profile.toml"))
    plain = fit_greybox(recording)
    nominal = plain.free[1].start
    assert plain.values[1] < 0.2 * nominal
    assert without_bias(plain, [recording]).values[1] == pytest.approx(nominal, rel=0.1)


def test_a_controller_that_the_profile_lacks_is_identified(
    step: Recording, plain: Estimate, corrected: Estimate
) -> None:
    bare = replace(step, profile=step.profile.model_copy(update={"controller": None}))
    assert without_bias(plain, [bare]).values[1] == pytest.approx(corrected.values[1], rel=0.1)


def test_without_a_known_controller_a_fit_stays_as_it_is(step: Recording, plain: Estimate) -> None:
    angle = step.angle.copy()
    angle[100] = np.nan  # with a lost sample the controller cannot be identified
    profile = step.profile.model_copy(update={"controller": None})
    assert without_bias(plain, [replace(step, profile=profile, angle=angle)]) is plain


def test_the_lag_is_not_too_short_although_the_scores_scatter_as_expected() -> None:
    steps = flown("steps", 40.0, device="mock:?speed=max&seed=23&hide=motor.lag:0.02", seed=23)
    plain = fit_greybox(steps)
    assert plain.inflation < 1.2
    lags = []
    for fit in (plain, without_bias(plain, [steps])):
        j = [f.name for f in fit.free].index("motor.lag.time_constant_s")
        lags.append((fit.values[j] - 0.02) / fit.std[j])
    assert lags[0] < -3
    assert abs(lags[1]) < 2.5
