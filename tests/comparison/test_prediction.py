from __future__ import annotations

import numpy as np
import pytest

from heli3dof.comparison.prediction import (
    ConstantAngles,
    common_rows,
    over_window_deg,
    predictions,
    rmse_deg,
    rows_within,
    stitched,
)
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile


def ramp(slope_deg_per_s: float = 2.0, duration_s: float = 12.0) -> Recording:
    t = np.arange(0, duration_s, 0.01)
    angle = np.radians(np.column_stack([slope_deg_per_s * t, 0 * t, -t]))
    return recording_of_arrays(t, np.zeros((len(t), 2)), angle, default_profile())


def test_constant_angles_have_an_error_of_slope_times_horizon() -> None:
    recording = ramp()
    made = predictions(ConstantAngles(), recording, (0.5, 1.0, 3.0))
    error = rmse_deg(recording, made)
    assert error[0.5] == pytest.approx([1.0, 0.0, 0.5])
    assert error[3.0] == pytest.approx([6.0, 0.0, 3.0])


def test_a_prediction_counts_if_all_its_rows_do() -> None:
    part = np.array([True, True, True, False, True, True])
    assert rows_within(part, 1).tolist() == [False, True, True, False, False, True]
    assert rows_within(part, 2).tolist() == [False, False, True, False, False, False]
    assert not rows_within(part, 6).any()


def test_the_error_over_a_window_of_a_ramp_is_its_end_over_root_three() -> None:
    """√(1/T ∫₀ᵀ (a t)² dt) = aT/√3; the trapezoid over 30 instants adds 1/(4·30²)."""
    recording = ramp()
    made = predictions(ConstantAngles(), recording, (3.0,))
    assert over_window_deg(rmse_deg(recording, made), made)[0] == pytest.approx(
        6.0 / np.sqrt(3), rel=0.0003
    )


def test_models_are_evaluated_on_the_same_rows() -> None:
    recording = ramp()
    early = predictions(ConstantAngles(), recording, (1.0,))
    late = predictions(ConstantAngles(), recording, (1.0,))
    late.ahead[1.0][:900] = np.nan
    rows = common_rows([early, late])
    assert rows[1.0][:, 0].sum() == len(recording) - 900


def test_an_axis_that_one_model_lacks_is_evaluated_for_the_others() -> None:
    recording = ramp()
    full, no_yaw = (predictions(ConstantAngles(), recording, (1.0,)) for _ in range(2))
    for y in no_yaw.ahead.values():
        y[:, 2] = np.nan
    rows = common_rows([full, no_yaw])
    assert rmse_deg(recording, full, rows)[1.0][2] == pytest.approx(1.0)
    assert np.isnan(rmse_deg(recording, no_yaw, rows)[1.0][2])


def test_stitched_windows_start_at_the_data() -> None:
    recording = ramp()
    t, angle = stitched(recording, predictions(ConstantAngles(), recording, (3.0,)))
    starts = np.concatenate([[0], np.flatnonzero(np.isnan(t))[:-1] + 1])
    assert t[starts] == pytest.approx([0, 3, 6, 9])
    np.testing.assert_allclose(np.degrees(angle[starts, 0]), 2.0 * t[starts])
    within = slice(int(starts[1]), int(starts[2]) - 1)
    np.testing.assert_allclose(np.degrees(angle[within, 0]), 6.0)  # constant throughout
    assert np.isnan(angle[np.isnan(t)]).all()
