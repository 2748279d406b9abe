"""`GreyBoxModel`: flies like the noiseless mock, linearises to the paper, goes through a file."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.experiment.plan import load_plan
from heli3dof.experiment.simulate import simulate
from heli3dof.identification.greybox.freeflight import flight_of
from heli3dof.model.control.closed_loop_poles import sampled_loop_poles
from heli3dof.model.control.loop_task import loop_task
from heli3dof.model.estimation.filter_data import RowRange, data_of
from heli3dof.model.greybox.model import GreyBoxModel, nominal
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.model_file import read_model, save_model
from heli3dof.rig.profile import default_profile
from tests.identification.known_flights import PARAMETERS, fly

PROFILE = default_profile()


@pytest.fixture(scope="module")
def still() -> object:
    return fly(1, "steps", noise=0.0, spread=0.0, rate_hz=500.0).recording


def true_model() -> GreyBoxModel:
    return nominal(PROFILE, tuple(n.rpartition(".")[0] for n in PARAMETERS), **PARAMETERS)


def test_it_flies_as_the_mock_does_without_noise_to_an_encoder_count(still) -> None:  # type: ignore[no-untyped-def]
    """From rest on the table, through take-off, to the end: two codes, one rig."""
    flown = simulate(load_plan("steps"), true_model())
    away = np.abs(np.degrees(flown.angle - still.angle[: len(flown)]))
    assert away.max(axis=0)[0] < 0.2
    assert away.max() < 0.4


def test_it_predicts_the_noiseless_mock_three_seconds_ahead(still) -> None:  # type: ignore[no-untyped-def]
    model = replace(true_model(), noise=np.array([0.005, 0.014, 0.002]))
    error = np.degrees(model.predict(still, 3.0) - still.angle)
    rms = np.sqrt(np.nanmean(error[still.t > 15.0] ** 2, axis=0))
    held = np.sqrt(np.mean(np.degrees(still.angle[1500:] - still.angle[:-1500]) ** 2, axis=0))
    assert (rms[:2] < [0.3, 0.5]).all()
    assert (rms < 0.1 * held).all()


def test_a_part_of_a_recording_is_simulated_at_its_own_time() -> None:
    """Predictions, the filter's input, fits to windows and replays continue a decline of thrust."""
    model = nominal(PROFILE, ("motor.thrust_drift",), **{"motor.thrust_drift.loss_per_s": 0.004})
    whole = simulate(load_plan("steps"), model)
    start = len(whole) // 2
    part = whole.rows(slice(start, None))
    away = np.degrees(model.predict(part, 1.0) - model.predict(whole, 1.0)[start:])
    assert np.abs(away[2000:]).max() < 0.1
    late = whole.t[start] - whole.t[0]
    assert flight_of(part).t[0] == pytest.approx(late)
    assert data_of([part], [RowRange(0, 0, 100)]).t[0] == pytest.approx(late)
    assert model.fly(loop_task(part)).t[0] == pytest.approx(late)


def test_linearised_at_hover_the_nominal_rig_is_the_papers_hover_model() -> None:
    linear = nominal(PROFILE).linear(PROFILE.dt)
    hover = hover_model(PROFILE)
    np.testing.assert_allclose(linear.A, hover.A, atol=1e-6)
    np.testing.assert_allclose(linear.B, hover.B, atol=1e-6)
    np.testing.assert_allclose(linear.u0, 7.456, atol=1e-6)
    assert PROFILE.controller is not None
    np.testing.assert_allclose(
        nominal(PROFILE).loop_poles(PROFILE.controller, PROFILE.dt)[:6],
        sampled_loop_poles(hover, PROFILE.controller, PROFILE.dt)[:6],
        atol=1e-3,
    )


def test_a_delay_of_whole_periods_is_the_same_rig_that_many_samples_later() -> None:
    late = nominal(PROFILE, ("motor.delay",), **{"motor.delay.delay_s": 3 * PROFILE.dt})
    plain, shifted = nominal(PROFILE).linear(), late.linear()
    impulse = [C @ np.linalg.matrix_power(A, k) @ B for A, B, C, k in (
        (plain.A, plain.B, plain.C, 10), (shifted.A, shifted.B, shifted.C, 13))]  # fmt: skip
    np.testing.assert_allclose(impulse[1], impulse[0], rtol=1e-9)


def test_it_reads_back_from_its_file_to_the_last_bit(tmp_path: Path) -> None:
    model = true_model()
    back = read_model(save_model(model, tmp_path / "m.json"))
    assert isinstance(back, GreyBoxModel)
    np.testing.assert_array_equal(back.values, model.values)
    assert back.terms == model.terms
    assert back.profile == model.profile


def test_a_file_with_an_unknown_term_is_refused_by_name(tmp_path: Path) -> None:
    path = save_model(true_model(), tmp_path / "m.json")
    data = json.loads(path.read_text())
    data["terms"][0] = "motor.warp_drive"
    path.write_text(json.dumps(data))
    with pytest.raises(RecordingError, match=r"motor\.warp_drive"):
        read_model(path)


def test_a_file_whose_parameters_do_not_fit_its_terms_is_refused(tmp_path: Path) -> None:
    path = save_model(true_model(), tmp_path / "m.json")
    data = json.loads(path.read_text())
    data["terms"].pop()
    path.write_text(json.dumps(data))
    with pytest.raises(RecordingError, match="its terms need"):
        read_model(path)


def test_a_rig_that_starts_level_is_held_by_its_thrusts() -> None:
    model = true_model()
    flown = simulate(load_plan("steps"), model, start="level")
    still = np.degrees(np.abs(flown.angle[:50]).max(axis=0))
    assert (still < 0.2).all()


def test_python_control_gets_the_linearisation_with_state_names() -> None:
    model = nominal(PROFILE)
    discrete = model.to_control()
    assert discrete.dt == PROFILE.dt
    np.testing.assert_array_equal(discrete.A, model.linear().A)
    assert discrete.state_labels == ["r", "p", "psi", "r_rate", "p_rate", "psi_rate"]
    assert discrete.input_labels == ["v_front_V", "v_back_V"]
    assert discrete.output_labels == ["roll_rad", "pitch_rad", "yaw_rad"]


def test_a_yaw_torque_couples_the_axes_of_the_linear_model() -> None:
    """At level no thrust balances it: ψ̈_0 acts through the products of inertia."""
    torque = {"bias.torque.yaw.torque_Nm": 0.01}
    model = nominal(PROFILE, ("bias.torque.yaw",), **torque)
    A = model.to_control(in_continuous_time=True).A
    without = nominal(PROFILE).to_control(in_continuous_time=True).A
    _, J_r, J_p, J_psi = model.values[:4]
    acceleration = 0.01 / J_psi
    coupling = (A - without)[3:, :2]  # of r̈, p̈, ψ̈ with r, p
    assert coupling[0, 1] == pytest.approx(-acceleration * J_p / J_r, rel=1e-3)
    assert coupling[1, 0] == pytest.approx(-acceleration, rel=1e-3)
    assert np.abs(coupling[[0, 1], [0, 1]]).max() < 1e-3 * acceleration


def test_rotor_thrusts_and_delayed_voltages_are_named_states() -> None:
    lag, late = {"motor.lag.time_constant_s": 0.1}, {"motor.delay.delay_s": 1.5 * PROFILE.dt}
    lagged = nominal(PROFILE, ("motor.lag",), **lag).to_control(in_continuous_time=True)
    assert lagged.state_labels[6:] == ["F_front", "F_back"]
    poles = np.sort(lagged.poles().real)
    np.testing.assert_allclose(poles[:2], -1 / 0.1, rtol=1e-5)
    delayed = nominal(PROFILE, ("motor.delay",), **late).to_control()
    assert delayed.state_labels[6:] == [
        "v_front_delayed_1", "v_back_delayed_1", "v_front_delayed_2", "v_back_delayed_2",
    ]  # fmt: skip


@pytest.mark.parametrize("tau", [1e-4, 1.2e-3, 0.1])
def test_a_lag_adds_one_pole_and_no_zero_at_any_sampling_interval(tau: float) -> None:
    """A lag far below the sampling interval leaves no trace in the discrete model's poles."""
    lagged = nominal(PROFILE, ("motor.lag",), **{"motor.lag.time_constant_s": tau})
    w = np.array([1.0, 30.0, 300.0])
    expected = nominal(PROFILE).linear().continuous().response(w).T / (1 + 1j * w * tau)
    for dt in (0.001, 0.01):
        G = lagged.linear(dt).continuous().response(w).T
        np.testing.assert_allclose(G, expected, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize(("names", "says"), [((), "0 effects>"), (("motor.lag",), "1 effect: ")])
def test_the_repr_of_a_model_counts_its_effects(names: tuple[str, ...], says: str) -> None:
    assert says in repr(nominal(default_profile(), names))


def test_the_repr_of_a_model_has_at_most_three_lines() -> None:
    for model in (nominal(PROFILE), true_model(), hover_model(PROFILE)):
        assert repr(model).count("\n") < 3
        assert model.name in repr(model)
        assert max(map(len, repr(model).splitlines())) <= 120
