"""Diagnosis of logs with sampling jitter: parts of it, on a quick fit of a real rig."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.diagnosis.free_run.diagnose_free_run import can_be_fitted, no_likelihood
from heli3dof.diagnosis.free_run.free_run_gain import FreeRun, free_run_gain, predicts_better
from heli3dof.diagnosis.free_run.residual_torques import _cross_validated_share
from heli3dof.diagnosis.free_run.unexplained import (
    explanation_sentences,
    steady_rows,
)
from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.greybox.linearisation import hover_voltage
from heli3dof.recording.recording import Recording
from tests.diagnosis import rig_a
from tests.identification.known_flights import fly


@pytest.fixture(scope="module")
def real() -> Recording:
    return rig_a.recording("closed-1a")


@pytest.fixture(scope="module")
def quick(real: Recording) -> MultiStepFit:
    return rig_a.quick()


def test_a_mock_flight_is_diagnosed_by_its_likelihood() -> None:
    assert not no_likelihood([fly(1022, until_s=40.0).recording.between(0, 10)])


@pytest.mark.parametrize(("seconds", "enough"), [(5, False), (8, False), (12, True)])
def test_only_what_the_fit_accepts_is_said_to_be_long_enough(seconds: int, enough: bool) -> None:
    flown = fly(1022, until_s=40.0).recording.between(0, seconds)
    assert can_be_fitted([flown]) == enough
    if enough:
        assert problem_of([flown]).flights
    else:
        with pytest.raises(RecordingError, match="fewer than 20 windows"):
            problem_of([flown])


def test_a_real_log_is_diagnosed_by_free_run_predictions(real: Recording) -> None:
    assert no_likelihood([real])


def test_a_roll_only_run_does_not_change_the_method(real: Recording) -> None:
    assert no_likelihood([real, rig_a.recording("open-roll-7V-1")])
    assert not no_likelihood([rig_a.recording("open-roll-7V-1")])


def test_a_higher_arm_needs_more_voltage(quick: MultiStepFit) -> None:
    """The owners of rig-a report about 9.6 V at +10° and 8.5 V at −10°."""
    low, high = hover_voltage(quick, -10), hover_voltage(quick, 10)
    assert 6.5 < low < 9.0 < high < 11.0


def test_steady_rows_are_in_flight_and_off_the_table(real: Recording) -> None:
    rows = steady_rows(real)
    assert len(rows) > 500
    assert rows[:, 0].min() > -20
    assert 6 < rows[:, 2].mean() < 12


def test_known_properties_of_the_rig_are_explained(quick: MultiStepFit, real: Recording) -> None:
    causes = ("encoder.offset.pitch", "stiffness.pendulum.roll", "motor.rotor_curve")
    text = " ".join(explanation_sentences(quick, [real], causes))
    for cause in causes:
        assert cause in text


def test_without_causes_there_is_no_explanation(quick: MultiStepFit, real: Recording) -> None:
    assert explanation_sentences(quick, [real], ()) == []


def test_a_gain_is_the_difference_of_two_rms_errors() -> None:
    """All errors fall from 2° to 1°, so each draw of the bootstrap gives 1°."""
    e = np.full((40, 12, 3), np.radians(2.0))
    cell = np.arange(40) // 4
    g = free_run_gain(FreeRun(e, cell), FreeRun(e / 2, cell), "holdout", 0)
    for interval in g.rmse_deg.values():
        assert interval is not None
        assert interval.value == pytest.approx(1.0)
        assert interval.low == pytest.approx(1.0)
    assert g.log_likelihood is None


def test_structure_is_detected_on_held_out_spans_and_noise_is_not() -> None:
    rng = np.random.default_rng(1001)
    z, t = rng.standard_normal(300), np.arange(300) * 0.4
    noise = rng.standard_normal(300)
    share, low, _ = _cross_validated_share(2 * np.abs(z) + noise, z, t)
    assert share > 0.3
    assert low > 0
    assert _cross_validated_share(noise, z, t)[0] < 0.1


def test_an_extension_pays_if_it_predicts_better_with_equal_axis_weights() -> None:
    """Ratios ½, ½, 1.5: ¼ + ¼ + 2.25 < 3. Ratios ½, ½, 2: ¼ + ¼ + 4 > 3."""
    e, cell = np.full((40, 12, 3), np.radians(2.0)), np.arange(40) // 4
    before = FreeRun(e, cell)
    assert predicts_better(before, FreeRun(e * [0.5, 0.5, 1.5], cell))
    assert not predicts_better(before, FreeRun(e * [0.5, 0.5, 2.0], cell))
    assert not predicts_better(before, before)
