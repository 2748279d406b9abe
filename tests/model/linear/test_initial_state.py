"""States at rest, and how uncertain a state is, whatever the basis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heli3dof.model.discretisation import c2d_zoh
from heli3dof.model.linear.hover import hover, hover_model
from heli3dof.model.linear.initial_state import rest_state, state_spread
from heli3dof.model.linear.model import LinearModel
from tests.model.examples import DEG, PROFILE, in_another_basis

HOVER = hover_model(PROFILE)


def with_rotor_lag(tau: float, stiffness: float = 0.0, dt: float = 0.002) -> LinearModel:
    """Hover with first-order rotors and a roll pendulum (rad/s² per rad)."""
    h = hover(PROFILE)
    A, B = np.zeros((8, 8)), np.zeros((8, 2))
    A[:6, :6], A[:6, 6:], A[6:, 6:] = h.A, h.B, -np.eye(2) / tau
    A[3, 0] = -stiffness
    B[6:] = np.eye(2) / tau
    A_d, B_d = c2d_zoh(A, B, dt)
    return LinearModel(
        "lag", "statespace", A_d, B_d, np.eye(3, 8), np.zeros((8, 3)), np.full((3, 3), np.nan),
        np.full(2, h.V_o), np.zeros(3), dt,
    )  # fmt: skip


def test_hover_at_rest_is_the_angles_and_no_rates() -> None:
    angle = np.array([-27.5, 4.0, 90.0]) * DEG
    assert rest_state(HOVER, angle).tolist() == [*angle, 0, 0, 0]


def test_rest_is_about_the_models_trim() -> None:
    trimmed = replace(HOVER, y0=np.array([0.1, 0.0, 0.0]))
    assert rest_state(trimmed, np.array([0.3, 0, 0]))[0] == pytest.approx(0.2)


def test_the_output_of_a_model_at_rest_is_the_angle_and_stays_under_some_voltage() -> None:
    # A pendulum held at −27.5° needs a steady thrust away from trim: rotors must be turning so.
    m = in_another_basis(with_rotor_lag(0.1, stiffness=1.0))
    angle = np.array([-27.5, 0, 30.0]) * DEG
    x = rest_state(m, angle)
    np.testing.assert_allclose(m.C @ x, angle, atol=1e-9)
    lift = hover(PROFILE).B[3, 0]
    u = np.full(2, -27.5 * DEG * 1.0 / (2 * lift))
    for _ in range(500):
        x = m.A @ x + m.B @ u
    np.testing.assert_allclose(m.C @ x, angle, atol=1e-7)


def test_rest_is_the_same_in_every_basis() -> None:
    a = with_rotor_lag(0.1, stiffness=1.0)
    b = in_another_basis(a, seed=3)
    angle = np.array([0.2, 0.0, -1.0])
    xa, xb = rest_state(a, angle), rest_state(b, angle)
    for _ in range(100):
        xa, xb = a.A @ xa, b.A @ xb
    np.testing.assert_allclose(a.C @ xa, b.C @ xb, atol=1e-8)


def test_an_axis_without_a_reading_rests_at_the_trim() -> None:
    assert rest_state(HOVER, np.array([0.1, np.nan, np.nan])).tolist() == [0.1, 0, 0, 0, 0, 0]


def test_spread_makes_the_free_response_uncertain_by_one_radian_in_every_basis() -> None:
    for m in (HOVER, in_another_basis(HOVER)):
        P = state_spread(m, np.ones(3, bool))
        variance = []
        free = m.C
        for _ in range(250):
            variance.append(np.trace(free @ P @ free.T))
            free = free @ m.A
        # n states at one unit each, seen through the mean over the window
        assert np.mean(variance) == pytest.approx(m.order, rel=0.1)
