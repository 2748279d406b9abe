"""Signals in MAT files of the forms that Simulink and MATLAB write, read as a user would."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from heli3dof.errors import RecordingError
from heli3dof.recording.load import load
from heli3dof.recording.logs.column_mapping import mapped
from heli3dof.recording.logs.importers.mat_file import read
from heli3dof.recording.logs.joined_tables import join
from heli3dof.recording.logs.matlab.signals import tables
from heli3dof.recording.logs.matlab.variables import Opaque
from tests.recording.make import flight, log_columns

T = np.arange(50) / 500
X = np.array([np.sin(T), np.cos(T)])


def columns(tmp_path: Path, variables: dict[str, Any], name: str = "x_enc.mat") -> dict[str, Any]:
    savemat(tmp_path / name, variables)
    return dict(read(tmp_path / name).columns)


def structure(values: np.ndarray, label: str = "") -> dict[str, Any]:
    return {"values": values, "label": label, "dimensions": float(values.shape[-1])}


def test_a_complex_angle_is_ignored_with_a_warning(tmp_path: Path) -> None:
    flown = flight(500)
    log = log_columns(flown)
    log["roll_deg"] = log["roll_deg"] + 0j
    savemat(tmp_path / "log.mat", log)
    recording = load(tmp_path / "log.mat", flown.profile)
    assert recording.axes == ("pitch", "yaw")
    warning = "The column roll_deg was ignored: complex numbers."
    assert warning in recording.meta["warnings"]


def test_an_array_of_structures_has_the_signals_of_its_elements(tmp_path: Path) -> None:
    """dSPACE's capture: X.Data is the time, Y(n).Data a signal; the names of both are texts."""
    y = np.zeros(2, dtype=[("Name", object), ("Data", object)])
    y["Name"], y["Data"][0], y["Data"][1] = ("elev", "Vf"), X[0], X[1]
    savemat(tmp_path / "log.mat", {"trace": {"X": {"Name": "time", "Data": T}, "Y": y}})
    table = read(tmp_path / "log.mat")
    assert list(table.columns) == ["Data", "Y[1].Data", "Y[2].Data"]
    assert "trace.Y[2].Name: text 'Vf'" in table.ignored
    found = mapped(table, {"t_s": "Data", "roll_rad": "trace.Y[2].Data"}, {}).columns
    np.testing.assert_array_equal(found["t_s"], T)
    np.testing.assert_array_equal(found["roll_rad"], X[1])


@pytest.mark.parametrize("transpose", [False, True])
def test_the_first_row_or_column_of_a_matrix_is_time(tmp_path: Path, transpose: bool) -> None:
    matrix = np.vstack([T, X])
    found = columns(tmp_path, {"x": matrix.T if transpose else matrix})
    assert list(found) == ["t_s", "x[1]", "x[2]"]
    np.testing.assert_array_equal(found["t_s"], T)
    np.testing.assert_array_equal(found["x[2]"], X[1])


def test_the_matrix_of_a_to_file_block_has_the_files_name(tmp_path: Path) -> None:
    assert list(columns(tmp_path, {"ans": np.vstack([T, X])}))[1:] == ["x_enc[1]", "x_enc[2]"]
    assert list(columns(tmp_path, {"ans": np.vstack([T, X[:1]])})) == ["t_s", "x_enc"]


def test_a_structure_with_time_is_read(tmp_path: Path) -> None:
    found = columns(tmp_path, {"S": {"time": T, "signals": structure(X.T), "blockName": "m/x"}})
    assert list(found) == ["t_s", "S[1]", "S[2]"]
    np.testing.assert_array_equal(found["S[1]"], X[0])


def test_the_labels_of_several_signals_are_their_names(tmp_path: Path) -> None:
    signals = np.array([structure(X.T[:, :1], "theta"), structure(X.T[:, 1:], "psi")])
    found = columns(tmp_path, {"S": {"time": T, "signals": signals}})
    assert list(found) == ["t_s", "theta", "psi"]
    np.testing.assert_array_equal(found["psi"], X[1])


def test_values_with_time_as_their_third_axis_are_read(tmp_path: Path) -> None:
    found = columns(tmp_path, {"S": {"time": T, "signals": structure(X.reshape(2, 1, 50))}})
    np.testing.assert_array_equal(found["S[2]"], X[1])


def test_a_structure_with_time_and_data_is_read_as_a_timeseries(tmp_path: Path) -> None:
    found = columns(tmp_path, {"theta": {"Time": T, "Data": X[0], "Name": "theta"}})
    assert list(found) == ["t_s", "theta"]


def test_structures_without_time_share_the_vector_of_times(tmp_path: Path) -> None:
    """To Workspace, format "Structure": the field time is empty; tout is a variable."""
    empty = np.zeros((0, 0))
    several = np.array([structure(X.T[:, :1], "theta"), structure(X.T[:, 1:], "psi")])
    found = columns(
        tmp_path,
        {
            "tout": T[:, None],
            "volt": {"time": empty, "signals": structure(X.T)},
            "ang": {"time": empty, "signals": structure(X.reshape(2, 1, 50))},
            "scope": {"time": empty, "signals": several},
            "other": {"signals": several},
        },
    )
    names = ["volt[1]", "volt[2]", "ang[1]", "ang[2]", "theta", "psi", "other.theta", "other.psi"]
    assert list(found) == ["t_s", "tout", *names]
    for name, values in zip(names, [*X, *X, *X, *X], strict=True):
        np.testing.assert_array_equal(found[name], values)


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (("u", "y"), ["u[1]", "u[2]", "y"]),
        (("u", "u"), ["u[1]", "u[2]", "ds[2].u"]),
        (("", ""), ["Values[1]", "Values[2]", "ds[2].Values"]),
    ],
)
def test_elements_with_a_name_and_a_timeseries_have_this_name(
    tmp_path: Path, names: tuple[str, str], expected: list[str]
) -> None:
    elements = np.zeros(2, dtype=[("Name", object), ("Values", object)])
    elements[0] = (names[0], {"Time": T, "Data": X.T})
    elements[1] = (names[1], {"Time": T, "Data": X[1]})
    found = columns(tmp_path, {"ds": elements})
    assert list(found) == ["t_s", *expected]
    np.testing.assert_array_equal(found[expected[2]], X[1])


def test_labels_that_two_structures_share_get_the_structures_name(tmp_path: Path) -> None:
    both = np.array([structure(X.T[:, :1], "theta"), structure(X.T[:, 1:], "psi")])
    found = columns(tmp_path, {n: {"time": T, "signals": both} for n in ("A", "B")})
    assert list(found) == ["t_s", "theta", "psi", "B.theta", "B.psi"]


def test_vectors_and_matrices_share_the_vector_of_times(tmp_path: Path) -> None:
    variables = {"tout": T, "Vf": X[0], "yout": np.vstack([T, X]).T, "gain": 3.0, "short": T[:20]}
    savemat(tmp_path / "a.mat", variables)
    table = read(tmp_path / "a.mat")
    assert list(table.columns) == ["t_s", "tout", "Vf", "yout[1]", "yout[2]"]
    assert table.ignored == ["gain: one value", "short: 20 values"]


def test_variables_with_clocks_of_their_own_are_joined(tmp_path: Path) -> None:
    late = {"Time": T[10:], "Data": X[0, 10:]}
    found = columns(tmp_path, {"u": np.vstack([T, X[1]]), "theta": late})
    np.testing.assert_array_equal(found["t_s"], T[10:])
    np.testing.assert_array_equal(found["theta"], X[0, 10:])


def test_vectors_without_any_time_keep_their_names(tmp_path: Path) -> None:
    assert list(columns(tmp_path, {"Vf": X[0], "Vb": X[1]})) == ["Vf", "Vb"]
    with pytest.raises(RecordingError, match="different lengths"):
        columns(tmp_path, {"Vf": X[0], "Vb": X[1, :30]})


def test_a_field_can_be_mapped_by_its_full_path(tmp_path: Path) -> None:
    flight = {"zeit": T, "ist": {"roll": X[0], "x": -X}, "soll": {"roll": X[1]}}
    savemat(tmp_path / "a.mat", {"flug": flight, "sim": {"soll": {"roll": 2 * X[1]}}})
    table = read(tmp_path / "a.mat")
    assert [n for n in table.columns if "roll" in n] == ["roll", "soll.roll", "sim.soll.roll"]
    expressions = {"t_s": "flug.zeit", "roll_deg": "flug.ist.roll", "v_front_V": "flug.ist.x[2]",
                   "pitch_deg": "flug.soll.roll", "yaw_deg": "sim.soll.roll"}  # fmt: skip
    found = mapped(table, expressions, {}).columns
    for name, values in zip(expressions, (T, X[0], -X[1], X[1], 2 * X[1]), strict=True):
        np.testing.assert_array_equal(found[name], values)


def test_a_full_path_has_its_files_prefix_if_two_files_have_it(tmp_path: Path) -> None:
    for file in ("a", "b"):
        savemat(tmp_path / f"{file}.mat", {"flug": {"t": T, "u": X[0], file: X[1]}})
    table = join([read(tmp_path / f"{file}.mat") for file in ("a", "b")])
    found = mapped(table, {"v_front_V": "b.flug.u", "v_back_V": "flug.b"}, {}).columns
    np.testing.assert_array_equal(found["v_front_V"], X[0])
    np.testing.assert_array_equal(found["v_back_V"], X[1])


def test_an_object_of_a_matlab_class_is_ignored_with_the_way_to_convert_it() -> None:
    found = tables("a.mat", "a", {"theta": Opaque("timeseries"), "u": np.vstack([T, X])})
    assert "theta = struct('Time', theta.Time, 'Data', theta.Data)" in found[0].ignored[0]


def test_a_file_without_signals_is_refused_with_what_it_contains(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"contains no signals\. It contains note"):
        columns(tmp_path, {"note": "windy"})
