"""The equations of motion against point masses in space and hand calculations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from heli3dof_drivers.emulator import plant_layout
from heli3dof_drivers.emulator.body import body_of
from heli3dof_drivers.emulator.lagrange import (
    accelerations,
    gravity,
    mass_matrix,
    velocity_torques,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.rig.profile import default_profile, profile_from_dict
from tests.drivers.conserved import energy, travel_momentum

TABLE = default_profile()
LOPSIDED = profile_from_dict(
    {**TABLE.to_dict(), "mass": {"m_w": 1.7, "m_f": 0.65, "m_b": 0.52}}, source="test"
)
angle = st.floats(-1.2, 1.2)
rate = st.floats(-3, 3)
few = settings(max_examples=60, deadline=None)


def positions(profile, q: np.ndarray) -> np.ndarray:
    """(3, 3) m: counterweight, front and back motor in space, by rotating vectors about axes."""

    def turn(axis: np.ndarray, a: float, x: np.ndarray) -> np.ndarray:
        cross = np.cross(axis, x)
        return x + math.sin(a) * cross + (1 - math.cos(a)) * np.cross(axis, cross)

    r, p, psi = q
    # Level, along x; the front motor towards positive travel (counter-clockwise: +y).
    L_w, L_a, L_h = profile.geometry.L_w, profile.geometry.L_a, profile.geometry.L_h
    points = np.array([[-L_w, 0, 0], [L_a, L_h, 0], [L_a, -L_h, 0]])
    x, y, z = np.eye(3)
    tilted = [turn(x, p, v) for v in points]
    raised = [turn(-y, r, v) for v in tilted]
    return np.array([turn(z, psi, v) for v in raised])


def jacobians(profile, q: np.ndarray, h: float = 1e-6) -> np.ndarray:
    """(3 points, 3 components, 3 coordinates) m/rad, by central differences."""
    columns = [
        (positions(profile, q + h * e) - positions(profile, q - h * e)) / (2 * h) for e in np.eye(3)
    ]
    return np.stack(columns, axis=-1)


def matrix(body: np.ndarray, q: np.ndarray) -> np.ndarray:
    rr, rp, ry, pp, py, yy = mass_matrix(body, q[0], q[1])
    return np.array([[rr, rp, ry], [rp, pp, py], [ry, py, yy]])


@few
@given(angle, angle, angle)
def test_the_mass_matrix_is_that_of_three_point_masses_in_space(r, p, psi):
    q = np.array([r, p, psi])
    for profile in (TABLE, LOPSIDED):
        masses = np.array([profile.mass.m_w, profile.mass.m_f, profile.mass.m_b])
        J = jacobians(profile, q)
        expected = np.einsum("n,nci,ncj->ij", masses, J, J)
        np.testing.assert_allclose(matrix(body_of(profile).vector(), q), expected, atol=1e-8)


@few
@given(angle, angle, rate, rate, rate)
def test_velocity_torques_follow_from_the_mass_matrix_by_lagrange(r, p, rd, pd, yd):
    body = body_of(LOPSIDED).vector()
    q, qd, h = np.array([r, p, 0.0]), np.array([rd, pd, yd]), 1e-6
    dM = [(matrix(body, q + h * e) - matrix(body, q - h * e)) / (2 * h) for e in np.eye(3)]
    expected = sum(dM[i] * qd[i] for i in range(3)) @ qd
    expected -= 0.5 * np.array([qd @ dM[i] @ qd for i in range(3)])
    got = velocity_torques(body, r, p, rd, pd, yd)
    np.testing.assert_allclose(got, expected, atol=1e-7)


@few
@given(angle, angle, angle, st.floats(-3, 3), st.floats(-3, 3))
def test_generalised_thrusts_do_the_virtual_work_of_forces_along_the_normal(r, p, psi, front, back):
    q, body = np.array([r, p, psi]), body_of(TABLE).vector()
    points, J = positions(TABLE, q), jacobians(TABLE, q)
    along = (points[1] - points[2]) / np.linalg.norm(points[1] - points[2])
    arm = -points[0] / np.linalg.norm(points[0])
    normal = np.cross(arm, along)
    Q = J[1].T @ (front * normal) + J[2].T @ (back * normal)
    acc = np.empty(3)
    accelerations(body, q, np.zeros(3), front, back, np.zeros(3), acc)
    g_r, g_p = gravity(body, r, p)
    np.testing.assert_allclose(matrix(body, q) @ acc, Q - [g_r, g_p, 0], atol=1e-8)


@few
@given(angle, angle)
def test_gravity_is_the_slope_of_the_potential_energy(r, p):
    body, zero, h = body_of(LOPSIDED).vector(), np.zeros(3), 1e-6
    slope = [
        (energy(body, np.array([r, p, 0]) + d, zero) - energy(body, np.array([r, p, 0]) - d, zero))
        / (2 * h)
        for d in (np.array([h, 0, 0]), np.array([0, h, 0]))
    ]
    np.testing.assert_allclose(gravity(body, r, p), slope, atol=1e-7)


def test_a_heavier_front_motor_hangs_lower():
    _, g_p = gravity(body_of(LOPSIDED).vector(), 0.0, 0.0)
    # (0.65 − 0.52) kg · 9.81 m/s² · 0.1778 m, pulling pitch down: ∂U/∂p > 0.
    assert g_p == pytest.approx(0.22675, abs=1e-5)


def test_the_level_rigs_inertias_are_the_papers():
    # 1.87·0.4699² + 1.15·0.6604² = 0.412907 + 0.501547; 1.15·0.1778²; their sum.
    J_roll, J_pitch, J_yaw = body_of(TABLE).J
    assert J_roll == pytest.approx(0.914455, abs=1e-6)
    assert J_pitch == pytest.approx(0.036355, abs=1e-6)
    assert J_yaw == pytest.approx(0.950809, abs=1e-6)
    np.testing.assert_allclose(
        np.diag(matrix(body_of(TABLE).vector(), np.zeros(3))), [J_roll, J_pitch, J_yaw]
    )


def level(dq: tuple[float, float, float], V_f: float, V_b: float) -> np.ndarray:
    """q̈ at rest near level, from voltages."""
    body, acc = body_of(TABLE).vector(), np.empty(3)
    K_f = body[plant_layout.K_F]
    accelerations(body, np.array(dq), np.zeros(3), K_f * V_f, K_f * V_b, np.zeros(3), acc)
    return acc


def test_hover_is_an_equilibrium_at_V_o():
    np.testing.assert_allclose(level((0, 0, 0.3), 7.456, 7.456), 0, atol=1e-15)


def test_linearised_at_hover_it_is_the_corrected_hover_model():
    h = 1e-6
    V_o = 7.456
    # (11), roll row: L_a K_f / J_roll = 0.6604·0.1188/0.914455
    per_front = (level((0, 0, 0), V_o + h, V_o) - level((0, 0, 0), V_o - h, V_o)) / (2 * h)
    per_back = (level((0, 0, 0), V_o, V_o + h) - level((0, 0, 0), V_o, V_o - h)) / (2 * h)
    np.testing.assert_allclose(per_front, [0.085795, 0.58101, 0], atol=5e-6)
    # pitch row, E4: K_f / (2 m_f L_h) = 0.1188/(2·0.575·0.1778) = 0.58101, not 3.268
    np.testing.assert_allclose(per_back, [0.085795, -0.58101, 0], atol=5e-6)
    # (10), E3: A[6,2] = −2 L_a K_f V_o / J_yaw = −1.169929/0.950809
    per_pitch = (level((0, h, 0), V_o, V_o) - level((0, -h, 0), V_o, V_o)) / (2 * h)
    np.testing.assert_allclose(per_pitch, [0, 0, -1.23046], atol=1e-5)
    # The rest of A's lower left is zero: no restoring torque at level.
    per_roll = (level((h, 0, 0), V_o, V_o) - level((-h, 0, 0), V_o, V_o)) / (2 * h)
    np.testing.assert_allclose(per_roll, 0, atol=1e-8)


@few
@given(angle, angle, rate, rate, rate, st.floats(-3, 3), st.floats(-3, 3))
def test_mirrored_in_the_arms_plane_the_motion_is_mirrored(r, p, rd, pd, yd, front, back):
    body, a, b = body_of(TABLE).vector(), np.empty(3), np.empty(3)
    q, qd, mirror = np.array([r, p, 0.2]), np.array([rd, pd, yd]), np.array([1, -1, -1])
    accelerations(body, q, qd, front, back, np.zeros(3), a)
    accelerations(body, mirror * q, mirror * qd, back, front, np.zeros(3), b)
    np.testing.assert_allclose(a, mirror * b, atol=1e-10)


def test_travel_momentum_of_the_level_rig_is_yaw_inertia_times_rate():
    body = body_of(TABLE).vector()
    momentum = travel_momentum(body, np.zeros(3), np.array([0.5, 0.5, 2.0]))
    assert momentum == pytest.approx(2 * 0.950809, abs=1e-5)


def test_measured_inertias_are_those_of_the_level_rig() -> None:
    measured = {"roll": 1.1, "pitch": 0.05, "yaw": 1.0}
    profile = profile_from_dict({**TABLE.to_dict(), "inertia": measured}, source="test")
    body = body_of(profile)
    assert np.diag(matrix(body.vector(), np.zeros(3))) == pytest.approx(list(measured.values()))
    # Away from level only the masses' part changes; the rest is on the joints.
    q = np.array([0.4, 0.3, 0.0])
    change = matrix(body.vector(), q) - matrix(body_of(TABLE).vector(), q)
    assert change == pytest.approx(np.diag(body.dJ))
