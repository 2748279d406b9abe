"""The nonlinear rigid body: numbers worked out by hand, and what mechanics conserves."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.model.physics import state_layout as s_
from heli3dof.model.physics.parametrisation import thrust_per_volt_ratio
from heli3dof.model.physics.rigid_body import body_accelerations
from heli3dof.model.physics.state_layout import context
from heli3dof.rig.profile import default_profile

ALL = np.ones(3, dtype=bool)
L_A, L_H, K_F, V_O = 0.6604, 0.1778, 0.1188, 7.456
J_R, J_P, J_PSI = 0.914453, 0.036354, 0.950807
T_G = 2 * L_A * K_F * V_O


def acceleration(q=(0, 0, 0), rate=(0, 0, 0), force=(0, 0), torque=(0, 0, 0), free=ALL, **changed):  # type: ignore[no-untyped-def]
    s = context(default_profile())
    s[s_.R : s_.R + 3], s[s_.R_DOT : s_.R_DOT + 3] = q, rate
    for name, value in changed.items():
        s[getattr(s_, name)] = value
    a = np.empty(3)
    body_accelerations(s, np.array(force, float), np.array(torque, float), free, a)
    return a


def test_level_hover_needs_v_o_on_both_motors() -> None:
    F = K_F * V_O
    np.testing.assert_allclose(acceleration(force=(F, F)), 0, atol=1e-12)


def test_small_thrusts_about_hover_give_the_papers_entries_of_b() -> None:
    # (11), corrected: L_a K_f / J_roll = 0.0858 and K_f / (2 m_f L_h) = 0.5810 rad/s² per volt
    F = K_F * V_O
    a = acceleration(force=(F + K_F, F))
    assert a[0] == pytest.approx(0.0858, abs=5e-5)
    assert a[1] == pytest.approx(0.5810, abs=5e-5)


def test_a_tilted_body_turns_clockwise() -> None:
    # (10), erratum E3: −2 L_a K_f V_o / J_yaw = −1.2304 rad/s² per radian of pitch
    F = K_F * V_O
    assert acceleration(q=(0, 1e-4, 0), force=(F, F))[2] / 1e-4 == pytest.approx(-1.2304, abs=1e-4)


def test_without_thrust_the_arm_falls_as_t_g_cos_r() -> None:
    a = acceleration(q=(0.3, 0, 0))
    assert a[0] == pytest.approx(-T_G * np.cos(0.3) / J_R, rel=1e-5)


def test_more_inertia_than_the_masses_give_sits_on_the_joint() -> None:
    # Turning at ψ̇ = 2 with p = 0.2 the bar's own masses are flung by J_p sin p cos p ψ̇²; a rotor
    # on the shaft is not: with twice the inertia the same torque moves the axis half as much.
    flung = acceleration(q=(0, 0.2, 0), rate=(0, 0, 2.0), free=np.array([False, True, False]))[1]
    twice = acceleration(
        q=(0, 0.2, 0), rate=(0, 0, 2.0), free=np.array([False, True, False]), J_P=2 * J_P
    )[1]
    assert flung == pytest.approx(-np.sin(0.2) * np.cos(0.2) * 4.0, rel=1e-4)
    assert twice == pytest.approx(flung / 2, rel=1e-4)


def test_turning_flings_the_arm_level() -> None:
    # −sin r cos r ψ̇² (J_ψ − J_p)/J_r, and the level bar of the body adds −J_p sin r cos r ψ̇² + …
    still = acceleration(q=(0.3, 0, 0))[0]
    turning = acceleration(q=(0.3, 0, 0), rate=(0, 0, 2.0))[0]
    expected = -np.sin(0.3) * np.cos(0.3) * 4.0 * ((J_PSI - J_P) + J_P) / J_R
    coupled = J_P * np.cos(0.3) * 2.0 * np.sin(0.3) * 2.0 / J_R  # ω_a = sin r ψ̇, turned by cos r ψ̇
    assert turning - still == pytest.approx(expected + coupled, rel=1e-4)


def test_an_axis_that_is_held_does_not_move_and_does_not_push() -> None:
    free = np.array([False, True, False])
    a = acceleration(q=(0.2, 0.1, 0), force=(1.0, 0.5), free=free)
    np.testing.assert_allclose(a, [0, L_H * 0.5 / J_P, 0], rtol=1e-4)


angles = st.floats(-0.5, 0.5)
rates = st.floats(-2, 2)


@settings(max_examples=60, deadline=None)
@given(st.tuples(angles, angles), st.tuples(rates, rates, rates))
def test_without_thrust_energy_and_the_travels_momentum_are_conserved(q, rate) -> None:  # type: ignore[no-untyped-def]
    """d/dt of both along the motion, by differences of their own formulas."""
    q, v = np.array([*q, 0.0]), np.array(rate)
    a = acceleration(q=q, rate=v)

    def parts(q: np.ndarray, v: np.ndarray) -> tuple[float, float]:
        r, p = q[0], q[1]
        w_a = v[1] + np.sin(r) * v[2]
        w_n = np.sin(p) * v[0] + np.cos(r) * np.cos(p) * v[2]
        J_a = J_PSI - J_P
        arm = J_R * v[0] ** 2 + J_a * np.cos(r) ** 2 * v[2] ** 2
        energy = 0.5 * (arm + J_P * (w_a**2 + w_n**2)) + T_G * np.sin(r)
        momentum = J_a * np.cos(r) ** 2 * v[2]
        momentum += J_P * (w_a * np.sin(r) + w_n * np.cos(r) * np.cos(p))
        return energy, momentum

    e = 1e-5
    later = parts(q + e * v, v + e * a)
    before = parts(q - e * v, v - e * a)
    drift = (np.array(later) - np.array(before)) / (2 * e)
    np.testing.assert_allclose(drift, 0, atol=3e-5)


def test_the_masses_inertias_are_in_units_of_the_thrust_gain_too() -> None:
    nominal = np.array([T_G, J_R, J_P, J_PSI])
    # A K_f of 1.6 times the profile's: all four are 1/1.6; one that is off alone says nothing.
    assert thrust_per_volt_ratio(default_profile(), nominal / 1.6) == pytest.approx(
        1 / 1.6, rel=1e-5
    )
    assert thrust_per_volt_ratio(default_profile(), nominal * [1, 1, 1.7, 1]) == pytest.approx(
        1.0, rel=1e-5
    )
