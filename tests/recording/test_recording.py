from __future__ import annotations

import pickle
import sys
from copy import deepcopy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.logs.export import export
from heli3dof.recording.recording import recording_of_arrays
from tests.recording.make import changed, empty, flight, open_profile


def test_the_repr_is_three_lines_with_size_axes_and_channels() -> None:
    made = flight(501)
    made.channels["gust_m_s"] = np.zeros(501)  # type: ignore[index]
    first, second, third = repr(made).splitlines()
    assert first == "Recording 'made-up': 501 samples, 1.0 s at 500 Hz"
    assert second.startswith("  axes: roll, pitch, yaw; references: roll, pitch, yaw; profile: ")
    assert second.endswith("controller unknown")
    assert third == "  channels: gust_m_s"


def test_the_repr_names_an_outcome_other_than_completed() -> None:
    made = flight(501)
    for outcome, ending in (
        ("completed", "500 Hz"),
        ("tripped", "; the flight's outcome: tripped"),
    ):
        cut = replace(made, meta={**made.meta, "outcome": outcome})
        assert repr(cut).splitlines()[0].endswith(ending)


def test_the_repr_of_many_channels_counts_those_that_it_does_not_list() -> None:
    made = flight(20)
    made.channels.update({f"c{i:02}": np.zeros(20) for i in range(30)})  # type: ignore[attr-defined]
    assert repr(made).endswith("c07 and 22 more")
    assert len(repr(made).splitlines()) == 3


def test_a_part_of_a_part_counts_time_from_the_whole_recordings_first_sample() -> None:
    made = replace(flight(501), t=7.0 + 0.002 * np.arange(501))
    part = made.between(7.2, 7.8).rows(slice(50, None))
    np.testing.assert_allclose(part.elapsed_s, part.t - 7.0)
    np.testing.assert_allclose(made.elapsed_s, made.t - 7.0)


def test_an_empty_recording_has_a_repr() -> None:
    assert "0 samples" in repr(empty())


@pytest.mark.filterwarnings("error")
def test_an_empty_recording_has_a_duration_and_tables() -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    assert empty().duration == 0
    assert np.isnan(empty().dt)
    assert len(empty().to_dataframe()) == 0
    assert empty().to_xarray().sizes == {"t_s": 0}


def test_a_selection_without_samples_is_refused() -> None:
    made = flight(501)
    for start, stop in ((0.5, 0.1), (float("nan"), 1), (5, 9), ("a", 3)):
        with pytest.raises(UsageError, match="made-up has no samples between") as caught:
            made.between(start, stop)  # type: ignore[arg-type]
        assert "t = 0 s to 1 s" in caught.value.cause
    assert len(made.between(-np.inf, np.inf)) == 501
    for keep in (slice(0, 0), np.zeros(501, bool), np.zeros(3, bool), [10**6], "a", None):
        with pytest.raises(UsageError, match="contains none of the 501"):
            made.rows(keep)  # type: ignore[arg-type]


def test_no_calculation_on_a_recordings_arrays_changes_it() -> None:
    voltage, meta = np.ones((9, 2)), {"plan": {"name": "own"}}
    made = recording_of_arrays(
        np.arange(9.0), voltage, np.ones((9, 3)), open_profile(), channels={"gust": np.ones(9)},
        meta=meta,
    )  # fmt: skip
    voltage[:] = 7.0
    meta["plan"]["name"] = "changed"
    assert (made.voltage == 1).all()
    assert made.meta["plan"]["name"] == "own"
    made.between(0, 5).meta["plan"]["name"] = "changed"
    assert made.meta["plan"]["name"] == "own"
    other = replace(made, angle=np.zeros((9, 3)))
    parts = (made, made.rows(slice(0, 4)), made.between(2, 5), other)
    for part in (*parts, pickle.loads(pickle.dumps(made)), deepcopy(made)):
        for array in (part.t, part.voltage, part.angle, part.channels["gust"]):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0


def test_an_empty_recording_is_neither_drawn_nor_exported(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="has no samples"):
        empty().plot()
    with pytest.raises(RecordingError, match="has no samples"):
        export(empty(), tmp_path / "a.csv")


def test_tables_of_a_recording_are_copies() -> None:
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    made = flight(50)
    digest, data = made.digest, made.to_xarray()
    data["v_front_V"] -= 7.0
    frame = made.to_dataframe()
    frame["v_front_V"] -= 7.0
    assert made.digest == digest


def test_a_data_frame_has_the_contracts_columns_over_t_s() -> None:
    pytest.importorskip("pandas")
    made = flight(50)
    made = changed(made, "angle", (slice(None), 1), np.nan)
    frame = made.to_dataframe()
    assert frame.index.name == "t_s"
    assert list(frame)[:4] == ["v_front_V", "v_back_V", "v_front_cmd_V", "v_back_cmd_V"]
    assert "pitch_deg" not in frame
    np.testing.assert_allclose(frame["roll_deg"], np.degrees(made.angle[:, 0]))


def test_a_data_set_has_the_same_columns_with_units() -> None:
    pytest.importorskip("xarray")
    made = flight(50)
    data = made.to_xarray()
    assert data.sizes == {"t_s": 50}
    assert data["roll_deg"].attrs == {"units": "deg"}
    assert data.attrs["digest"] == made.digest
    np.testing.assert_array_equal(data["v_back_V"], made.voltage[:, 1])


@pytest.mark.parametrize("library", ["pandas", "xarray"])
def test_without_the_library_the_error_names_the_install_command(
    library: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    convert = {"pandas": flight(20).to_dataframe, "xarray": flight(20).to_xarray}[library]
    with pytest.raises(UsageError, match=f"{library} is not installed") as caught:
        convert()
    assert f"pip install 'heli3dof[{library}]'" in caught.value.fix
