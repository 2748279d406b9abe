"""Eqs (3)–(14) for Table I, by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from heli3dof.model.linear.hover import (
    hover,
    hover_model,
    quiescent_voltage,
)
from heli3dof.rig.profile import Profile
from tests.model.examples import PROFILE, with_motor


def test_inertias_of_table_1_are_those_of_three_point_masses() -> None:
    # 1.87 · 0.4699² = 0.41291, 1.15 · 0.6604² = 0.50155, 1.15 · 0.1778² = 0.036355
    J_roll, J_pitch, J_yaw = PROFILE.inertias
    assert J_roll == pytest.approx(0.41291 + 0.50155, abs=1e-5)
    assert J_pitch == pytest.approx(0.036355, abs=1e-6)
    assert J_yaw == pytest.approx(0.41291 + 0.50155 + 0.036355, abs=1e-5)


def test_quiescent_voltage_of_table_1_is_7_456_V_from_a_torque_of_1_170_Nm() -> None:
    assert round(PROFILE.gravity_torque, 3) == 1.170
    assert round(quiescent_voltage(PROFILE), 3) == 7.456


def test_corrected_matrices_hold_the_numbers_of_the_checked_paper() -> None:
    h = hover(PROFILE)
    assert h.A[5, 1].round(4) == -1.2305  # with the profile's V_o, 7.456 V, rounded from (6)
    assert h.B[4].round(4).tolist() == [0.5810, -0.5810]
    assert h.B[3] == pytest.approx(0.6604 * 0.1188 / 0.914455)
    assert h.A[:3, 3:].tolist() == np.eye(3).tolist()
    assert np.count_nonzero(h.A) == 4
    assert np.count_nonzero(h.B) == 4
    assert h.C.tolist() == np.eye(3, 6).tolist()


def test_corrected_travel_follows_the_profiles_V_o_and_not_its_masses() -> None:
    calibrated = with_motor(PROFILE, V_o=9.0)
    assert hover(calibrated).A[5, 1] == pytest.approx(hover(PROFILE).A[5, 1] * 9.0 / 7.456)
    assert hover(calibrated, printed=True).A[5, 1] == hover(PROFILE, printed=True).A[5, 1]


def test_unequal_motors_are_weighed_one_by_one_in_the_corrected_model() -> None:
    uneven = PROFILE.model_copy(update={"mass": PROFILE.mass.model_copy(update={"m_b": 0.675})})
    assert uneven.inertias[1] == pytest.approx((0.575 + 0.675) * 0.1778**2)
    assert np.array_equal(hover(uneven, printed=True).B, hover(PROFILE, printed=True).B)


@pytest.mark.parametrize("printed", [False, True])
def test_hover_model_is_the_exact_hold_at_the_control_rate(printed: bool) -> None:
    h, m = hover(PROFILE, printed=printed), hover_model(PROFILE, printed=printed)
    assert m.dt == 0.002
    assert np.array_equal(m.u0, [h.V_o, h.V_o])
    np.testing.assert_allclose(m.A, expm(h.A * 0.002), atol=1e-15)
    # Constant acceleration a for dt: angle a dt²/2, rate a dt.
    assert m.B[0, 0] == pytest.approx(h.B[3, 0] * 0.002**2 / 2)
    assert m.B[3, 0] == pytest.approx(h.B[3, 0] * 0.002)
    assert not m.K.any()


def test_python_control_gets_the_continuous_matrices_with_state_names() -> None:
    s = hover_model(PROFILE).to_control(in_continuous_time=True)
    h = hover(PROFILE)
    assert s.isctime()
    for ours, theirs in ((h.A, s.A), (h.B, s.B), (h.C, s.C), (np.zeros((3, 2)), s.D)):
        np.testing.assert_allclose(theirs, ours, atol=1e-10)
    assert s.state_labels == ["r", "p", "psi", "r_rate", "p_rate", "psi_rate"]


def test_all_motion_is_a_chain_of_integrators_without_damping() -> None:
    assert np.abs(np.linalg.eigvals(hover(PROFILE).A)).max() == 0


def test_hover_model_can_be_had_at_another_rate() -> None:
    slow: Profile = PROFILE.model_copy(
        update={"loop": PROFILE.loop.model_copy(update={"rate_hz": 200.0})}
    )
    assert hover_model(slow).dt == 0.005
    np.testing.assert_allclose(hover_model(slow).A, hover_model(PROFILE, dt=0.005).A)
