"""Poles of the loop: the paper's, and the sampled one as it flies."""

from __future__ import annotations

import numpy as np
import pytest

from heli3dof.model.control.closed_loop_poles import (
    closed_loop,
    ideal_loop_poles,
    rightmost_first,
    sampled_loop_poles,
)
from heli3dof.model.linear.closed_loop import fly
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.linear.model import LinearModel
from tests.model.examples import DEG, PROFILE, SPEC, in_another_basis, step_task

HOVER = hover_model(PROFILE)


def test_hover_in_the_loop_has_the_golden_poles() -> None:
    golden = [-0.100, -0.317, -1.144 + 1.865j, -1.144 - 1.865j]
    golden += [-1.537 + 0.790j, -1.537 - 0.790j, -1.635 + 1.656j, -1.635 - 1.656j]
    assert HOVER.loop_poles(SPEC, 0.002).round(3).tolist() == golden


def test_a_fast_filter_and_a_fast_rate_bring_the_sampled_poles_to_the_ideal_ones() -> None:
    fast = SPEC.model_copy(update={"derivative_cutoff_hz": 2000.0})
    sampled = sampled_loop_poles(HOVER, fast, 1e-5)[:8]
    np.testing.assert_allclose(sampled, ideal_loop_poles(HOVER, SPEC), atol=5e-3)


def test_poles_do_not_depend_on_the_basis() -> None:
    other = in_another_basis(HOVER)
    np.testing.assert_allclose(
        other.loop_poles(SPEC, 0.002)[:8], sampled_loop_poles(HOVER, SPEC, 0.002)[:8], atol=1e-5
    )


def test_the_slowest_sampled_pole_is_how_the_flight_dies_out() -> None:
    # Roll alone, long after the step: what is left falls by e^{−0.317 t}.
    roll = fly(HOVER, step_task(roll=10, duration_s=25)).angle[:, 0] / DEG - 10
    rate = np.log(roll[11_000] / roll[10_000]) / 2.0
    slowest = sampled_loop_poles(HOVER, SPEC, 0.002)
    assert rate == pytest.approx(-0.317, abs=0.001)
    assert abs(slowest - rate).min() < 1e-3


def test_integrals_without_a_gain_or_an_axis_are_left_out() -> None:
    assert len(ideal_loop_poles(HOVER, SPEC)) == 8
    proportional = SPEC.model_copy(update={"K": tuple((*row[:6], 0.0, 0.0) for row in SPEC.K)})
    assert len(ideal_loop_poles(HOVER, proportional)) == 6
    assert len(sampled_loop_poles(HOVER, proportional, 0.002)) == 12
    C = HOVER.C.copy()
    C[2] = 0.0
    no_yaw = LinearModel(**{**HOVER.__dict__, "C": C})
    assert len(sampled_loop_poles(no_yaw, SPEC, 0.002)) == 6 + 4 + 1


def test_a_delayed_model_has_no_pole_for_its_delay() -> None:
    n = HOVER.order
    A = np.zeros((n + 2, n + 2))
    A[:n, :n], A[:n, n:] = HOVER.A, HOVER.B
    B = np.vstack([np.zeros((n, 2)), np.eye(2)])
    C = np.hstack([HOVER.C, np.zeros((3, 2))])
    delayed = LinearModel(
        **{**HOVER.__dict__, "A": A, "B": B, "C": C, "K": np.zeros((n + 2, 3)), "exact_hold": False}
    )
    poles = delayed.loop_poles(SPEC, 0.002)
    assert np.isfinite(poles).all()
    assert poles.real.max() < 0


def test_a_rate_that_answers_the_voltage_at_once_is_solved_for() -> None:
    # ẏ = u on roll alone, u = −k_p y − k_d ẏ: the pole is −k_p / (1 + k_d).
    A, B, C = np.zeros((1, 1)), np.array([[1.0, 0.0]]), np.array([[1.0], [0.0], [0.0]])
    K = np.zeros((2, 8))
    K[0, 0], K[0, 3] = 6.0, 2.0
    A_cl, _, _ = closed_loop(A, B, C, K)
    assert A_cl[0, 0] == pytest.approx(-2.0)


def test_poles_come_rightmost_first_and_pairs_together() -> None:
    poles = rightmost_first(np.array([-2, 1, -1 - 2j, -1 + 2j]))
    assert poles.tolist() == [1, -1 + 2j, -1 - 2j, -2]
