"""Prediction from data so far: causal, exact where the model is, fast."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.model.base import LoopResult
from heli3dof.model.linear.closed_loop import fly
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.linear.model import LinearModel
from heli3dof.model.linear.prediction import kalman_gains, predict
from heli3dof.recording.recording import Recording, recording_of_arrays
from tests.model.examples import DEG, PROFILE, in_another_basis, step_task
from tests.model.linear.test_initial_state import with_rotor_lag
from tests.pace import timed
from tests.paths import REAL_DATA, needs_real_data
from tests.recording.make import changed

HOVER = hover_model(PROFILE)
GRID = PROFILE.encoder.rad_per_count


def recorded(result: LoopResult, *, quantised: bool = True) -> Recording:
    angle = np.round(result.angle / GRID) * GRID if quantised else result.angle
    return recording_of_arrays(result.t, result.voltage, angle, PROFILE)


def hover_flight(duration_s: float = 12.0, **options: bool) -> Recording:
    return recorded(fly(HOVER, step_task(10, 3, 15, duration_s=duration_s)), **options)


def noisy(model: LinearModel, N: int, seed: int) -> tuple[Recording, np.ndarray]:
    """A record drawn from a model in innovation form, and its innovations."""
    rng = np.random.default_rng(seed)
    e = rng.multivariate_normal(np.zeros(3), model.S, size=N)
    v = model.u0 + np.repeat(rng.normal(size=(N // 100 + 1, 2)), 100, axis=0)[:N]
    x, y = np.zeros(model.order), np.empty((N, 3))
    for k in range(N):
        y[k] = model.C @ x + model.y0 + e[k]
        x = model.A @ x + model.B @ (v[k] - model.u0) + model.K @ e[k]
    return recording_of_arrays(np.arange(N) * model.dt, v, y, PROFILE), e


def innovation_model(order_seed: int = 0) -> LinearModel:
    """Rotors, a pendulum and a Kalman gain that is somebody's, in a random basis."""
    plant = with_rotor_lag(0.1, stiffness=1.0)
    sigma = np.diag([3e-4, 4e-4, 2e-4]) ** 2
    record = recording_of_arrays(
        np.arange(3000) * 0.002, np.zeros((3000, 2)), np.zeros((3000, 3)), PROFILE
    )
    K = kalman_gains(plant, record, np.ones(3, bool))[-1]
    return in_another_basis(replace(plant, K=K, S=sigma), seed=order_seed)


def test_a_flight_of_the_model_itself_is_predicted_to_within_some_encoder_counts() -> None:
    # The filter is set for rigs that differ from the model, so rounding shows a little: rates
    # are known to a count per 0.1 s.
    flight = hover_flight()
    for horizon, counts in ((0.002, 0.5), (0.1, 1.5), (1.0, 10.0)):
        error = (predict(HOVER, flight, horizon) - flight.angle)[1000:] / abs(GRID)
        assert np.sqrt(np.mean(error**2, axis=0)).max() < counts, horizon


def test_a_flight_of_the_model_itself_without_rounding_is_predicted_exactly() -> None:
    flight = hover_flight(quantised=False)
    for horizon in (0.002, 0.1, 1.0):
        error = predict(HOVER, flight, horizon) - flight.angle
        np.testing.assert_allclose(error[round(horizon / 0.002) :], 0, atol=1e-7)


def test_rows_before_the_horizon_have_no_prediction_and_the_others_have_one() -> None:
    y = predict(HOVER, hover_flight(), 0.5)
    assert np.isnan(y[:250]).all()
    assert np.isfinite(y[250:]).all()


@pytest.mark.parametrize("model", [HOVER, innovation_model(), in_another_basis(HOVER)])
def test_angles_after_k_minus_horizon_and_voltages_from_k_on_do_not_matter(
    model: LinearModel,
) -> None:
    flight = hover_flight(3.0)
    h, k = 100, 1200
    spoilt = changed(flight, "angle", slice(k - h + 1, None), flight.angle[k - h + 1 :] + 1.0)
    spoilt = changed(spoilt, "voltage", slice(k, None), flight.voltage[k:] + 5.0)
    before, after = predict(model, flight, h * 0.002), predict(model, spoilt, h * 0.002)
    np.testing.assert_allclose(after[: k + 1], before[: k + 1], atol=1e-9)
    touched = changed(flight, "angle", k - h, flight.angle[k - h] + 0.01)
    assert abs(predict(model, touched, h * 0.002)[k] - before[k]).max() > 1e-5


def test_the_convolution_equals_rolling_the_model_forward_step_by_step() -> None:
    model, flight = innovation_model(), hover_flight(2.0)
    h = 37
    from heli3dof.model.linear.prediction import filtered_states

    x = filtered_states(model, flight, np.ones(3, bool), flight.voltage - model.u0)
    got = predict(model, flight, h * 0.002)
    for k in (h, 300, 999):
        state = x[k - h + 1]
        for j in range(k - h + 1, k):
            state = model.A @ state + model.B @ (flight.voltage[j] - model.u0)
        np.testing.assert_allclose(got[k], model.C @ state + model.y0, atol=1e-9)


def test_one_step_errors_of_the_innovation_form_are_the_innovations() -> None:
    model = innovation_model()
    flight, e = noisy(model, 4000, seed=7)
    error = flight.angle - predict(model, flight, model.dt)
    # From an uncertain start; by then the filter has forgotten it.
    np.testing.assert_allclose(error[2500:], e[2500:], atol=3e-5)
    assert np.std(error[500:], axis=0) == pytest.approx(np.std(e, axis=0), rel=0.05)


def test_a_wrong_start_is_forgotten_within_half_a_second() -> None:
    flight = hover_flight(quantised=False)
    middle = flight.between(0.5, 8.0)  # mid-manoeuvre: the rates are far from zero
    error = (predict(HOVER, middle, 0.1) - middle.angle) / DEG
    assert abs(error[50:55]).max() > 1.0
    assert abs(error[300:]).max() < 0.01


def test_a_biased_voltage_costs_what_it_does_within_the_horizon_and_no_more() -> None:
    # 0.05 V too much on both motors: r̈ is off by 2 · 0.0858 · 0.05 rad/s², half of it times t²
    # after 1 s is 0.25°, while replay from t = 0 would be 25° off after 10 s.
    flight = hover_flight()
    biased = replace(flight, voltage=flight.voltage + 0.05)
    error = (predict(HOVER, biased, 1.0) - flight.angle)[3000:, 0] / DEG
    acceleration = 2 * 0.6604 * 0.1188 / 0.914455 * 0.05 / DEG
    assert np.mean(error) == pytest.approx(acceleration / 2, rel=0.25)


def test_an_axis_that_was_not_measured_is_not_predicted_and_does_no_harm() -> None:
    flight = hover_flight(quantised=False)
    lost = changed(flight, "angle", (slice(None), 2), np.nan)
    for model in (HOVER, replace(innovation_model(), y0=np.array([0.0, 0.0, 0.1]))):
        y = predict(model, lost, 0.1)
        assert np.isnan(y[:, 2]).all()
        assert np.isfinite(y[50:, :2]).all()
    error = (predict(HOVER, lost, 0.1) - flight.angle)[1000:, :2] / DEG
    assert abs(error).max() < 1e-6


def test_an_axis_that_is_not_modelled_is_not_predicted() -> None:
    C = HOVER.C.copy()
    C[1] = np.nan
    y = predict(replace(HOVER, C=C), hover_flight(), 0.1)
    assert np.isnan(y[:, 1]).all()
    assert np.isfinite(y[50:, [0, 2]]).all()


def test_single_lost_readings_and_voltages_are_bridged() -> None:
    flight = hover_flight(quantised=False)
    holes = changed(flight, "angle", slice(1000, None, 97), np.nan)
    holes = changed(holes, "voltage", 1500, np.nan)
    error = (predict(HOVER, holes, 0.1) - flight.angle)[100:]
    assert abs(error).max() / DEG < 0.01


def test_samples_that_never_came_are_bridged_and_cost_no_time() -> None:
    flight = hover_flight(quantised=False)
    there = np.delete(np.arange(len(flight)), np.arange(1000, len(flight) - 1, 97))
    # In a flight that goes on without them, each lost row would be a step of the clock swallowed.
    error = (predict(HOVER, flight.rows(there), 0.1) - flight.angle[there])[100:]
    assert abs(error).max() / DEG < 0.01


def test_hover_predicts_at_any_rate_and_an_identified_model_at_its_own_only() -> None:
    flight = hover_flight()
    halved = flight.rows(slice(None, None, 2))
    error = (predict(HOVER, halved, 0.1) - halved.angle)[500:] / DEG
    # The voltage picked every other sample is not the one that was held: that costs little here.
    assert np.sqrt(np.mean(error**2, axis=0)).max() < 0.1
    with pytest.raises(RecordingError, match="every 2 ms, not every 4 ms") as caught:
        predict(innovation_model(), halved, 0.1)
    assert caught.value.exit_code == 5


def test_a_rate_within_one_percent_of_the_models_is_taken_for_its_own() -> None:
    flight = hover_flight()
    near = replace(flight, t=flight.t * 1.005)
    assert np.isfinite(predict(innovation_model(), near, 0.1)[60:]).all()


def test_a_horizon_longer_than_the_record_predicts_nothing() -> None:
    assert np.isnan(predict(HOVER, hover_flight(0.5), 1.0)).all()


def test_sixty_seconds_at_500_hz_one_second_ahead_take_less_than_a_second() -> None:
    flight = hover_flight(60.0)
    for model in (HOVER, innovation_model()):
        assert timed(partial(predict, model, flight, 1.0)) < 1.0


def test_a_gain_without_a_noise_covariance_is_used_as_it_stands() -> None:
    model, flight = innovation_model(), hover_flight()
    for S in (np.full((3, 3), np.nan), np.zeros((3, 3))):
        unknown = replace(model, S=S)
        late = slice(3000, None)
        np.testing.assert_allclose(
            predict(unknown, flight, 0.1)[late], predict(model, flight, 0.1)[late], atol=1e-3
        )


def real_recording(name: str) -> Recording:
    """One of rig-a's logs, with Table I's rig for a profile: nothing about it is fitted."""
    table = np.genfromtxt(REAL_DATA / "rig-a" / name, delimiter=",", names=True)
    return recording_of_arrays(
        table["t_s"],
        np.column_stack([table["v_front_V"], table["v_back_V"]]),
        np.radians(np.column_stack([table[f"{a}_deg"] for a in ("roll", "pitch", "yaw")])),
        PROFILE,
    )


@needs_real_data
@pytest.mark.real_data
def test_on_a_real_rig_the_hover_model_of_table_1_predicts_worse_than_standing_still() -> None:
    # The paper's criticism of its hover model, on data that the authors never saw.
    flight = real_recording("closed-1b.csv")
    airborne = flight.between(3.0, np.inf)
    error = (predict(HOVER, airborne, 1.0) - airborne.angle)[500:] / DEG
    still = (airborne.angle[200:] - airborne.angle[:-200])[300:] / DEG
    assert np.isfinite(error).all()
    rms, rms_still = (np.sqrt(np.mean(e**2, axis=0)) for e in (error, still))
    assert rms[0] > 1.3 * rms_still[0]
    assert rms[0] < 20  # yet no open-loop replay: that drifts by far more
