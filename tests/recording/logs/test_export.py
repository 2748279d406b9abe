"""Export to other programs, and import again."""

from __future__ import annotations

import builtins
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import loadmat

from heli3dof.errors import OutputExists, UsageError
from heli3dof.recording.columns import export_columns
from heli3dof.recording.logs.export import export, write_csv
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.logs.importers.csv_file import read as read_csv
from heli3dof.recording.mcap_files.reader import read_recording
from tests.recording.make import changed, flight, open_profile, write_flight

ARRAYS = ("t", "voltage", "angle", "reference", "voltage_cmd", "voltage_extra")


@pytest.mark.parametrize("name", ["a.csv", "a.csv.gz", "a.mat"])
def test_an_exported_flight_imports_to_the_same_arrays(tmp_path: Path, name: str) -> None:
    made = flight(1000)
    made.channels["gust m/s"] = np.linspace(0, 1, 1000)  # type: ignore[index]
    back = import_log(export(made, tmp_path / name), open_profile())
    for array in ARRAYS:
        np.testing.assert_allclose(
            getattr(back, array), getattr(made, array), rtol=0, atol=1e-12, err_msg=array
        )
    gust = "gust_m_s" if name.endswith(".mat") else "gust m/s"
    np.testing.assert_array_equal(back.channels[gust], made.channels["gust m/s"])
    assert back.meta["warnings"] == []


def test_counts_and_flags_survive_csv(tmp_path: Path) -> None:
    flown = read_recording(write_flight(tmp_path / "a.mcap", 100))
    path = export(flown, tmp_path / "a.csv")
    text = path.read_text().splitlines()
    header = text[0].split(",")
    assert header[:3] == ["t_s", "v_front_V", "v_back_V"]
    assert text[3].split(",")[header.index("roll_count")] == "-2"
    table = read_csv(path).columns
    for name, values in flown.channels.items():
        np.testing.assert_array_equal(table[name], values)


def test_absent_columns_stay_absent(tmp_path: Path) -> None:
    made = changed(flight(50), "angle", (slice(None), 1), np.nan)
    assert not {"pitch_deg", "v_front_extra_V"} & export_columns(made).keys()
    assert import_log(export(made, tmp_path / "a.csv"), open_profile()).axes == ("roll", "yaw")


@settings(max_examples=100, deadline=None)
@given(st.lists(st.floats(width=64), min_size=10, max_size=30))
def test_every_digit_survives_csv(tmp_path_factory, values: list[float]) -> None:
    path = tmp_path_factory.getbasetemp() / "digits.csv"
    t = np.arange(len(values)) / 7
    path.write_bytes(write_csv({"t_s": t, "x, y\nz": np.array(values)}))
    table = read_csv(path)
    np.testing.assert_array_equal(table.columns["t_s"], t)
    np.testing.assert_array_equal(table.columns["x, y z"], values)


def test_parquet_carries_columns_profile_and_provenance(tmp_path: Path) -> None:
    from pyarrow import parquet

    made = flight(100)
    path = export(made, tmp_path / "a.parquet")
    table = parquet.read_table(path)
    np.testing.assert_array_equal(table["roll_deg"].to_numpy(), np.rad2deg(made.angle[:, 0]))
    about = table.schema.metadata
    assert json.loads(about[b"heli3dof.profile"]) == made.profile.to_dict()
    assert json.loads(about[b"heli3dof.meta"])["seed"] == 1


def test_mat_vectors_have_names_that_matlab_accepts(tmp_path: Path) -> None:
    made = flight(100)
    made.channels["3rd gust (m/s)"] = np.arange(100.0)  # type: ignore[index]
    result = loadmat(export(made, tmp_path / "a.mat"))
    assert result["roll_deg"].shape == (100, 1)
    assert result["c3rd_gust__m_s_"].shape == (100, 1)
    assert json.loads(str(result["profile_json"][0])) == made.profile.to_dict()


def test_without_pyarrow_the_error_names_the_install_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("pyarrow"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UsageError, match="pyarrow") as caught:
        export(flight(20), tmp_path / "a.parquet")
    assert "pip install 'heli3dof[parquet]'" in caught.value.fix


@pytest.mark.parametrize("name", ["a.csv", "a.mat", "a.parquet"])
def test_export_never_overwrites_without_force(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_text("precious")
    with pytest.raises(OutputExists, match="force=True"):
        export(flight(20), path)
    assert path.read_text() == "precious"
    export(flight(20), path, force=True)
    assert path.read_bytes()[:8] != b"precious"


def test_an_unknown_ending_names_the_known_ones_and_suggests_none(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"There is no export format '\.txt'") as caught:
        export(flight(20), tmp_path / "a.txt")
    assert "did you mean" not in str(caught.value)
    assert ".parquet" in str(caught.value.fix)
