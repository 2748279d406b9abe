"""MAT files of version 7.3, written in MATLAB's layout."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from heli3dof.errors import UsageError
from heli3dof.recording.logs.importers.mat_file import read
from heli3dof.recording.logs.matlab.variables import Opaque, read_variables

T = np.arange(50) / 500
X = np.array([np.sin(T), np.cos(T)])


def write_v73(path: Path, variables: dict[str, Any]) -> Path:
    """MATLAB's layout: 512 bytes of header, axes in reverse order, elements by reference."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        refs = file.create_group("#refs#")

        def put(group: Any, name: str, value: Any) -> None:
            if isinstance(value, str):
                codes = np.array([list(value.encode("utf-16-le")[::2])], dtype=np.uint16).T
                group[name], kind = codes, "char"
            elif isinstance(value, dict):
                group.create_group(name)
                for key, inner in value.items():
                    put(group[name], key, inner)
                kind = "struct"
            elif isinstance(value, list):  # an array of structures
                elements = group.create_group(name)
                for key in value[0]:
                    for i, each in enumerate(value):
                        put(refs, f"{key}{i}", each[key])
                    links = [refs[f"{key}{i}"].ref for i in range(len(value))]
                    elements.create_dataset(key, data=[links], dtype=h5py.ref_dtype)
                kind = "struct"
            else:
                group[name], kind = np.atleast_2d(value).T, "double"
            group[name].attrs["MATLAB_class"] = np.bytes_(kind)

        for name, value in variables.items():
            put(file, name, value)
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as stream:
        stream.write(header)
    return path


def test_version_7_3_gives_the_same_columns_as_version_5(tmp_path: Path) -> None:
    signals = [{"values": x[:, np.newaxis], "label": n} for x, n in zip(X, "ab", strict=True)]
    variables: dict[str, Any] = {
        "ans": np.vstack([T, X]),
        "S": {"time": T[:, np.newaxis], "signals": signals},
        "note": "windy",
    }
    new = read(write_v73(tmp_path / "u.mat", variables))
    (tmp_path / "old").mkdir()
    savemat(tmp_path / "old" / "u.mat", {**variables, "S": {"time": T, "signals": signals}})
    old = read(tmp_path / "old" / "u.mat")
    assert set(new.columns) == {"t_s", "u[1]", "u[2]", "a", "b"} == set(old.columns)
    for name, values in old.columns.items():
        np.testing.assert_array_equal(new.columns[name], values)
    assert new.ignored == old.ignored == ["note: text 'windy'"]


def test_objects_of_matlab_classes_are_marked(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    path = write_v73(tmp_path / "a.mat", {"theta": np.arange(6)})
    with h5py.File(path, "r+") as file:
        file["theta"].attrs["MATLAB_class"] = np.bytes_("timeseries")
        file["theta"].attrs["MATLAB_object_decode"] = 3
    assert read_variables(path) == {"theta": Opaque("timeseries")}


def test_without_h5py_the_error_has_the_command_that_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_v73(tmp_path / "a.mat", {"x": T})
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(UsageError, match=r"version 7\.3") as caught:
        read_variables(path)
    assert "pip install 'heli3dof[h5py]'" in caught.value.fix
