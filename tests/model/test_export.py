"""Models as MAT files, read with SciPy's reader."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.linalg import expm

import heli3dof as h3
from heli3dof.model.export import export
from heli3dof.model.greybox.model import nominal
from heli3dof.model.linear.hover import hover_model
from heli3dof.model.linear.model import LinearModel
from heli3dof.rig.profile import default_profile

PROFILE = default_profile()


def read(path: Path) -> dict[str, Any]:
    return loadmat(path, squeeze_me=True, chars_as_strings=True)


def step(A: np.ndarray, B: np.ndarray, C: np.ndarray, n: int) -> np.ndarray:
    """Angles n samples after a step of 1 V on the front motor."""
    x = np.zeros(len(A))
    for _ in range(n):
        x = A @ x + B[:, 0]
    return np.asarray(C @ x)


def test_the_hover_model_is_eq_8_in_continuous_time(tmp_path: Path) -> None:
    found = read(export(hover_model(PROFILE), tmp_path / "a.mat"))
    J_roll, J_pitch, _ = PROFILE.inertias
    g, K_f = PROFILE.geometry, PROFILE.motor.K_f
    np.testing.assert_allclose(found["Bc"][3], g.L_a * K_f / J_roll * np.array([1, 1]), atol=1e-9)
    np.testing.assert_allclose(found["Bc"][4], g.L_h * K_f / J_pitch * np.array([1, -1]), atol=1e-9)
    assert found["continuous_by"] == "hold"
    assert found["Ts"] == PROFILE.dt
    np.testing.assert_array_equal(found["u0_V"], [7.456, 7.456])
    np.testing.assert_array_equal(found["y0_rad"], np.zeros(3))


def test_names_and_units_are_cell_arrays_of_text(tmp_path: Path) -> None:
    found = read(export(hover_model(PROFILE), tmp_path / "a.mat"))
    assert found["state_names"].tolist() == ["r", "p", "psi", "r_rate", "p_rate", "psi_rate"]
    assert found["state_units"].tolist() == ["rad"] * 3 + ["rad/s"] * 3
    assert found["input_names"].tolist() == ["v_front_V", "v_back_V"]
    assert found["input_units"].tolist() == ["V", "V"]
    assert found["output_names"].tolist() == ["roll_rad", "pitch_rad", "yaw_rad"]
    assert found["output_units"].tolist() == ["rad", "rad", "rad"]


def test_sampled_and_continuous_matrices_describe_the_same_model(tmp_path: Path) -> None:
    model = nominal(PROFILE, ("motor.lag",), **{"motor.lag.time_constant_s": 0.1})
    found = read(export(model, tmp_path / "a.mat"))
    n, size = 100, len(found["A"])
    M = np.zeros((size + 2, size + 2))
    M[:size] = np.column_stack([found["Ac"], found["Bc"]])
    continuous = found["Cc"] @ expm(M * n * found["Ts"])[:size, size]
    np.testing.assert_allclose(
        continuous, step(found["A"], found["B"], found["C"], n), rtol=1e-6, atol=1e-12
    )
    assert found["state_names"].tolist()[6:] == ["F_front", "F_back"]
    assert found["state_units"].tolist()[6:] == ["N", "N"]


def test_a_delay_gives_states_in_volts_and_a_bilinear_continuous_model(tmp_path: Path) -> None:
    model = nominal(PROFILE, ("motor.delay",), **{"motor.delay.delay_s": 0.004})
    found = read(export(model, tmp_path / "a.mat"))
    assert found["continuous_by"] == "bilinear"
    assert found["state_units"].tolist()[6:] == ["V"] * (len(found["A"]) - 6)
    assert found["Dc"].shape == (3, 2)


def test_an_axis_that_the_model_lacks_is_no_output(tmp_path: Path) -> None:
    C = np.array([[1.0, 0.0], [0.0, 1.0], [np.nan, np.nan]])
    model = LinearModel(
        "a", "pem", A=0.5 * np.eye(2), B=np.eye(2), C=C, K=np.arange(6.0).reshape(2, 3),
        S=np.full((3, 3), np.nan), u0=np.zeros(2), y0=np.array([0.1, 0.2, np.nan]), dt=0.002,
    )  # fmt: skip
    found = read(export(model, tmp_path / "a.mat"))
    assert found["output_names"].tolist() == ["roll_rad", "pitch_rad"]
    np.testing.assert_array_equal(found["C"], np.eye(2))
    np.testing.assert_array_equal(found["y0_rad"], [0.1, 0.2])
    np.testing.assert_array_equal(found["K"], [[0, 1], [3, 4]])
    assert [len(unit) for unit in found["state_units"]] == [0, 0]


@pytest.mark.parametrize("name", ["A", "B", "C", "D", "Ac", "Bc", "Cc", "Dc", "u0_V", "y0_rad"])
def test_every_number_is_finite(tmp_path: Path, name: str) -> None:
    found = read(export(nominal(PROFILE), tmp_path / "a.mat"))
    assert np.isfinite(found[name]).all()


def test_export_takes_a_model_as_well(tmp_path: Path) -> None:
    model = h3.hover_model(h3.default_profile())
    written = h3.export(model, tmp_path / "x.mat")
    assert loadmat(written)["A"].shape == (6, 6)
    with pytest.raises(h3.OutputExists):
        h3.export(model, tmp_path / "x.mat")
    with pytest.raises(
        h3.UsageError, match=r"A model can be exported as \.mat only, not as x\.csv"
    ):
        h3.export(model, tmp_path / "x.csv")
