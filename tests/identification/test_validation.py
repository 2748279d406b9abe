from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.identification.preprocessing import prepare
from heli3dof.identification.validation import (
    loop_task,
    metrics,
    predictions,
    replay_obstacle,
    replays,
    score,
)
from heli3dof.model.linear.hover import hover_model
from heli3dof.recording.recording import Recording
from tests.identification.flights import flight


@pytest.fixture(scope="module")
def flown() -> Recording:
    return flight("steps", seed=1, seconds=20)


def test_the_fit_is_the_hand_computed_one() -> None:
    # y = ±1 about 0; ŷ is off by 0.5 everywhere: 100 (1 − 0.5/1) = 50 %
    y = np.tile([[1.0], [-1.0]], (10, 3))
    result = score([(y, y - 0.5)])
    np.testing.assert_allclose(result.fit_percent, 50)
    np.testing.assert_allclose(result.rmse, 0.5)
    assert result.rows == 20


def test_rows_without_a_prediction_are_not_scored() -> None:
    y = np.tile([[1.0], [-1.0]], (10, 3))
    predicted = y.copy()
    predicted[:4] = np.nan
    assert score([(y, predicted)]).rows == 16
    assert np.isnan(score([(y, np.full_like(y, np.nan))]).fit_percent).all()


def test_each_pair_is_measured_against_its_own_mean() -> None:
    y = np.tile([[1.0], [-1.0]], (10, 3))
    result = score([(y, y - 0.5), (y + 100, y + 99.5)])
    np.testing.assert_allclose(result.fit_percent, 50)


def test_a_constant_angle_has_an_error_but_no_fit() -> None:
    y = np.column_stack([np.full(50, 0.1), np.linspace(0, 1, 50), np.full(50, -0.3)])
    found = score([(y, y + 0.01)])
    assert np.isnan(found.fit_percent).tolist() == [True, False, True]
    assert found.rmse == pytest.approx([0.01] * 3)


def test_predictions_of_held_out_rows_use_the_rows_before(flown: Recording) -> None:
    p = prepare([flown])
    model = hover_model(flown.profile)
    ((y, predicted),) = predictions(model, p, p.held_out, 0.5)
    run = p.held_out[0]
    np.testing.assert_array_equal(y, flown.angle[run.start : run.stop])
    assert np.isfinite(predicted).all()
    whole = model.predict(flown, 0.5)[run.start : run.stop]
    np.testing.assert_allclose(predicted, whole, atol=1e-3)


def test_a_separate_recording_has_a_warm_up(flown: Recording) -> None:
    p = prepare([flown], held_out=[flight("steps", seed=2, seconds=20)])
    ((_, predicted),) = predictions(hover_model(flown.profile), p, p.held_out, 0.5)
    assert np.isnan(predicted[:1250]).all()  # 2 s to settle and the horizon, at 500 Hz
    assert np.isfinite(predicted[1250:]).all()


def test_replay_flies_the_recording_s_own_loop(flown: Recording) -> None:
    task = loop_task(flown)
    assert flown.profile.controller is not None
    np.testing.assert_array_equal(task.reference, flown.reference)
    np.testing.assert_array_equal(task.extra, flown.voltage_extra)
    assert task.V_o == flown.profile.motor.V_o


def test_replay_is_scored_on_the_given_rows_only(flown: Recording) -> None:
    p = prepare([flown])
    ((y, predicted),) = replays(hover_model(flown.profile), p, p.held_out)
    assert len(y) == len(predicted) == p.held_out[0].stop - p.held_out[0].start


def test_a_diverging_loop_has_a_huge_error(flown: Recording) -> None:
    p = prepare([flown])
    model = hover_model(flown.profile)
    runaway = replace(model, B=-model.B)
    result = metrics(runaway, p, p.held_out)
    assert result.replay_note == "the loop with this model diverges"
    assert result.no_replay == ""  # there is a replay
    assert result.replay.fit_percent.min() < -1e3


def test_the_reason_for_no_replay_is_given(flown: Recording) -> None:
    unknown = replace(flown, profile=flown.profile.model_copy(update={"controller": None}))
    model = hover_model(flown.profile)
    result = metrics(model, prepare([unknown]), prepare([unknown]).held_out)
    assert "has no [controller]" in result.no_replay == result.replay_note
    assert np.isnan(result.replay.fit_percent).all()
    blind = replace(flown, reference=np.full_like(flown.reference, np.nan))
    assert "no reference was recorded" in replay_obstacle(prepare([blind]), [0], model)


def test_a_decimated_log_is_replayed_with_the_controllers_period(flown: Recording) -> None:
    slow = prepare([flown.rows(slice(None, None, 5))])
    model = hover_model(flown.profile)
    whole = metrics(model, prepare([flown]), prepare([flown]).held_out)
    result = metrics(model, slow, slow.held_out)
    assert result.no_replay == ""
    np.testing.assert_allclose(result.replay.rmse, whole.replay.rmse, rtol=0.05)
    result = metrics(hover_model(flown.profile, dt=0.01), slow, slow.held_out)
    assert "every 10 ms, as logged; the control period of " in result.no_replay


def test_every_horizon_of_the_contract_is_in_the_json(flown: Recording) -> None:
    p = prepare([flown])
    document = metrics(hover_model(flown.profile), p, p.held_out).to_json()
    for axis in ("roll", "pitch", "yaw"):
        keys = document["fit_percent"][axis]
        assert {"one_step", "0.1_s", "0.5_s", "1_s", "closed_loop_replay"} <= set(keys)
