"""The compiled loop: golden numbers of the sampled controller, and its promises."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.errors import RecordingError
from heli3dof.model.base import LoopTask
from heli3dof.model.control.controller import Controller
from heli3dof.model.linear.closed_loop import fly
from heli3dof.model.linear.hover import hover_model
from tests.bench.simulation_speed import simulation_speed
from tests.model.examples import DEG, PROFILE, SPEC, K_g, in_another_basis, step_task

HOVER = hover_model(PROFILE)


def test_a_10_degree_roll_step_peaks_at_11_75_degrees_in_the_sampled_loop() -> None:
    roll = fly(HOVER, step_task(roll=10)).angle[:, 0] / DEG
    assert roll.max() == pytest.approx(11.75, abs=0.005)
    assert roll[5000] == pytest.approx(10.10, abs=0.005)


def test_a_20_degree_yaw_step_in_the_sampled_loop() -> None:
    angle = fly(HOVER, step_task(yaw=20)).angle / DEG
    assert angle[:, 2].max() == pytest.approx(23.18, abs=0.03)
    assert angle[:, 1].min() == pytest.approx(-13.55, abs=0.03)


def test_from_rest_on_the_table_the_sampled_loop_peaks_at_16_2_degrees() -> None:
    roll = fly(HOVER, step_task(roll=10, start=(-27.5, 0, 0))).angle[:, 0] / DEG
    assert roll.max() == pytest.approx(16.2, abs=0.05)


def test_the_compiled_loop_equals_the_same_loop_written_out_in_python() -> None:
    task = step_task(roll=15, pitch=3, yaw=-30, start=(-10, 2, 5), duration_s=3, quantised=True)
    rng = np.random.default_rng(1)
    task.extra[:] = rng.normal(size=task.extra.shape)
    result = fly(HOVER, task)
    c = Controller(SPEC, task.V_o, task.v_max, task.dt)
    c.reset(task.angle0)
    x = np.concatenate([task.angle0, np.zeros(3)])
    for k in range(len(task.reference)):
        y = HOVER.C @ x
        np.testing.assert_allclose(result.angle[k], y, atol=1e-9)
        grid = task.rad_per_count
        seen = task.angle0 + np.round((y - task.angle0) / grid) * grid
        command, voltage = c.step(seen, task.reference[k], task.extra[k])
        np.testing.assert_allclose(result.voltage_cmd[k], command, atol=1e-6)
        np.testing.assert_allclose(result.voltage[k], voltage, atol=1e-6)
        x = HOVER.A @ x + HOVER.B @ (np.array(voltage) - HOVER.u0)


def test_the_same_model_in_another_basis_flies_alike() -> None:
    task = step_task(roll=10, yaw=10, start=(-5, 0, 20), duration_s=8)
    np.testing.assert_allclose(
        fly(in_another_basis(HOVER), task).angle, fly(HOVER, task).angle, atol=2e-6
    )


def test_the_first_reading_is_the_start_even_off_the_encoders_grid() -> None:
    task = step_task(start=(-27.53, 0.01, 0.02), duration_s=0.1, quantised=True)
    result = fly(HOVER, task)
    np.testing.assert_allclose(result.angle[0], task.angle0, atol=1e-12)
    free = fly(HOVER, step_task(start=(-27.53, 0.01, 0.02), duration_s=0.1))
    np.testing.assert_allclose(result.voltage_cmd[0], free.voltage_cmd[0])


def test_the_controller_sees_whole_encoder_counts() -> None:
    # A gain on roll alone: the voltage moves in steps of 37.6 V/rad times one count.
    only_roll = SPEC.model_copy(update={"K": ((37.6,) + (0.0,) * 7,) * 2})
    task = step_task(spec=only_roll, duration_s=1, quantised=True)
    task.extra[:] = 0.3
    command = fly(HOVER, task).voltage_cmd[:, 0] - 7.456 - 0.3
    count = 37.6 * 2 * np.pi / 4096
    np.testing.assert_allclose(command / count, np.round(command / count), atol=1e-6)
    assert len(np.unique(np.round(command / count))) > 3


def test_missing_references_and_extra_volts_count_as_zero() -> None:
    task = step_task(duration_s=1)
    task.reference[:, 1:] = np.nan
    task.extra[:] = np.nan
    np.testing.assert_allclose(
        fly(HOVER, task).angle, fly(HOVER, step_task(duration_s=1)).angle, atol=1e-12
    )


def test_a_diverging_loop_gives_numbers_and_not_an_exception() -> None:
    printed = hover_model(PROFILE, printed=True)
    result = fly(printed, step_task(yaw=10, duration_s=400))
    assert abs(result.angle[-1, 2]) > 1e3
    assert np.isfinite(result.voltage).all()


def test_hover_flies_at_any_control_rate_and_an_identified_model_only_at_its_own() -> None:
    task = step_task(roll=10, dt=0.001)
    assert fly(HOVER, task).angle[:, 0].max() / DEG == pytest.approx(11.8, abs=0.1)
    identified = in_another_basis(HOVER)
    identified = type(identified)(**{**identified.__dict__, "exact_hold": False})
    with pytest.raises(RecordingError, match="every 2 ms, not every 1 ms"):
        fly(identified, task)


def test_an_axis_that_is_not_modelled_is_nan_and_rests_for_the_controller() -> None:
    C = HOVER.C.copy()
    C[2] = np.nan
    partial = type(HOVER)(**{**HOVER.__dict__, "C": C, "exact_hold": False})
    result = fly(partial, step_task(roll=10, yaw=40, start=(0, 0, 40)))
    assert np.isnan(result.angle[:, 2]).all()
    assert result.angle[:, 0].max() / DEG == pytest.approx(11.75, abs=0.01)
    np.testing.assert_allclose(result.voltage[:, 0], result.voltage[:, 1], atol=1e-9)


def test_an_integral_removes_what_a_wrong_hover_voltage_would_leave() -> None:
    task = step_task(duration_s=60)
    off = LoopTask(**{**task.__dict__, "V_o": 7.456 - 0.5})
    assert abs(fly(HOVER, off).angle[-1, 0]) < 0.01 * DEG
    without = SPEC.model_copy(update={"K": tuple((*row[:6], 0.0, 0.0) for row in SPEC.K)})
    left = fly(HOVER, LoopTask(**{**off.__dict__, "controller": without})).angle[-1, 0]
    assert left == pytest.approx(-0.5 / K_g[0, 0], rel=1e-3)


def test_simulation_is_at_least_2000_times_faster_than_real_time() -> None:
    assert simulation_speed(duration_s=120, repeats=3) > 2000
