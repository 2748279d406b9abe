"""Logs of other programs: accepted forms, warnings and errors."""

from __future__ import annotations

import gzip
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from heli3dof.errors import RecordingError, UsageError
from heli3dof.integrity.remedies import column_of
from heli3dof.recording.load import load
from heli3dof.recording.logs.import_log import import_log, read_log
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import load_profile
from tests.paths import REAL_DATA, needs_real_data
from tests.recording.make import csv_text, flight, log_columns, open_profile

PROFILE = open_profile()


def columns(n: int = 1500) -> dict[str, Any]:
    return {name: np.array(values) for name, values in log_columns(flight(n)).items()}


def write(tmp_path: Path, content: dict[str, Any] | str | bytes, name: str = "log.csv") -> Path:
    path = tmp_path / name
    if isinstance(content, dict):
        content = csv_text(content)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


def warned(path: Path, words: str) -> bool:
    return any(words in w for w in import_log(path, PROFILE).meta["warnings"])


def test_a_clean_log_is_read_without_a_warning(tmp_path: Path) -> None:
    made = flight(1500)
    r = import_log(write(tmp_path, columns()), PROFILE)
    np.testing.assert_array_equal(r.t, made.t)
    np.testing.assert_array_equal(r.voltage, made.voltage)
    np.testing.assert_allclose(r.angle, made.angle, rtol=0, atol=1e-12)
    np.testing.assert_allclose(r.reference, made.reference, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(r.voltage_cmd, made.voltage_cmd)
    assert np.isnan(r.voltage_extra).all()
    assert r.meta["warnings"] == []
    assert r.meta["name"] == "log"
    assert len(r.meta["log"]["sha256"]) == 64


def test_order_is_free_unknown_columns_are_kept_and_an_angle_may_be_absent(tmp_path: Path) -> None:
    data = columns()
    del data["pitch_deg"], data["pitch_ref_deg"]
    data["gust m/s"] = np.linspace(0, 1, 1500)
    r = import_log(write(tmp_path, dict(reversed(data.items()))), PROFILE)
    assert r.axes == ("roll", "yaw")
    assert r.has_reference("yaw")
    assert not r.has_reference("pitch")
    np.testing.assert_array_equal(r.channels["gust m/s"], data["gust m/s"])


def test_radians_are_accepted_for_degrees(tmp_path: Path) -> None:
    data = columns()
    for name in [n for n in data if n.endswith("_deg")]:
        data[name.replace("_deg", "_rad")] = np.deg2rad(data.pop(name))
    r = import_log(write(tmp_path, data), PROFILE)
    np.testing.assert_allclose(r.angle, flight(1500).angle, rtol=0, atol=1e-12)
    assert r.meta["warnings"] == []
    assert column_of(r, "pitch") == ("pitch_rad", "pitch_rad")  # a remedy is in radians, too


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.replace(",", ";"), "semicolons"),
        (lambda t: t.replace(",", ";").replace(".", ","), "decimal commas"),
        (lambda t: t.replace(",", "\t").replace(".", ","), "decimal commas"),
        (lambda t: t.replace(",", "\t"), "tabs"),
        (lambda t: t.replace(",", " "), "spaces"),
    ],
)
def test_other_separators_are_accepted_with_a_note(tmp_path: Path, change, words: str) -> None:
    path = write(tmp_path, change(csv_text(columns())))
    assert words in " ".join(read_log(path, PROFILE).notes)
    assert import_log(path, PROFILE).meta["warnings"] == []
    np.testing.assert_array_equal(import_log(path, PROFILE).voltage, flight(1500).voltage)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: ("\ufeff" + t).encode(),
        lambda t: t.replace("\n", "\r\n").encode(),
        lambda t: ("# logged in room 3\n\n" + t).encode(),
        lambda t: t.encode("utf-16"),
        lambda t: t.replace("\n", ",\n").encode(),
        lambda t: (t + "\n\n").encode(),
        lambda t: t.rstrip("\n").encode(),
        lambda t: t.replace("t_s,v_front_V", '"t_s", "v_front_V"', 1).encode(),
        lambda t: gzip.compress(t.encode()),
    ],
)
def test_byte_order_marks_comments_and_line_endings_are_accepted(tmp_path: Path, change) -> None:
    r = import_log(write(tmp_path, change(csv_text(columns()))), PROFILE)
    np.testing.assert_array_equal(r.voltage, flight(1500).voltage)
    assert r.meta["warnings"] == []


@pytest.mark.parametrize("titles", ["Lab 3; flight of 1 May\n# period;2 ms\n", "Flight 3\n\n"])
@pytest.mark.parametrize("separator", [",", ";"])
def test_titles_above_the_header_are_skipped_with_a_note(
    titles: str, separator: str, tmp_path: Path
) -> None:
    table = csv_text(columns())
    if separator == ";":
        table = table.replace(",", ";").replace(".", ",")
    path = write(tmp_path, titles + table)
    np.testing.assert_array_equal(import_log(path, PROFILE).voltage, flight(1500).voltage)
    assert "The header is line 3; the lines above it were ignored." in (
        read_log(path, PROFILE).notes
    )


def test_text_in_another_encoding_is_not_called_binary(tmp_path: Path) -> None:
    path = write(tmp_path, "Höhe;Nick;Gier\n1;2;3\n".encode("latin-1"), "log.dat")
    with pytest.raises(RecordingError, match="it is a text table, possibly CSV"):
        import_log(path, PROFILE)
    path.write_bytes(b"\x01\xff\xfe\x00" * 100)
    with pytest.raises(RecordingError, match="it is a binary file of an unknown kind"):
        import_log(path, PROFILE)


def test_a_gzipped_log_is_read(tmp_path: Path) -> None:
    path = write(tmp_path, gzip.compress(csv_text(columns()).encode()), "log.csv.gz")
    assert import_log(path, PROFILE).name == "log"
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(RecordingError, match="cannot be decompressed"):
        import_log(path, PROFILE)


def changed(name: str, k: int, value: Any) -> dict[str, Any]:
    data = columns()
    data[name] = data[name].astype(object)
    data[name][k] = value
    return data


def renamed(old: str, new: str) -> dict[str, Any]:
    return {new if name == old else name: v for name, v in columns().items()}


def with_a_short_line(k: int) -> str:
    lines = csv_text(columns()).splitlines()
    lines[k] = lines[k].rpartition(",")[0]
    return "\n".join([*lines, ""])


def swapped_time(k: int) -> dict[str, Any]:
    data = columns()
    data["t_s"][[k, k + 1]] = data["t_s"][[k + 1, k]]
    return data


@pytest.mark.parametrize(
    ("content", "warning"),
    [
        (lambda: changed("roll_deg", 10, float("nan")), "1 of 1500 rows have a value that is not"),
        (lambda: changed("yaw_deg", 10, float("inf")), "the first is line 12, column yaw_deg."),
        (lambda: changed("v_back_V", 10, ""), "line 12, column v_back_V."),
        (lambda: changed("v_back_V", 10, "#N/A"), "line 12, column v_back_V."),
        (lambda: with_a_short_line(11), "1 of 1500 lines do not have 11 cells"),
    ],
)
def test_rows_without_numbers_are_lost_samples(tmp_path: Path, content, warning: str) -> None:
    path = write(tmp_path, content())
    kept = np.delete(np.arange(1500), 10)
    np.testing.assert_array_equal(import_log(path, PROFILE).t, flight(1500).t[kept])
    assert warned(path, warning)
    assert warned(path, "1 gap in time")


@pytest.mark.parametrize("brackets", ["{}", "[{}]", "({})", " [ {} ]"])
def test_a_line_of_units_is_skipped_and_gives_names_with_units(
    tmp_path: Path, brackets: str
) -> None:
    bare = {"t_s": "time", **{n: n.rpartition("_")[0] for n in columns() if n != "t_s"}}
    data = {bare[n]: v for n, v in columns().items() if n in bare}
    units = ",".join(brackets.format(n.rpartition("_")[2]) for n in columns())
    path = write(tmp_path, csv_text(data).replace("\n", f"\n{units}\n", 1))
    r = import_log(path, PROFILE)
    np.testing.assert_allclose(r.angle, flight(1500).angle, rtol=0, atol=1e-12)
    assert r.meta["warnings"] == []
    assert r.meta["log_mapping"]["roll_deg"] == "roll [deg]"
    assert list(read_log(path, PROFILE).notes)[:1] == ["Line 2 contains units and was skipped."]


def test_both_voltages_in_another_unit_are_corrected_at_once(tmp_path: Path) -> None:
    data = columns() | {n: 1000 * columns()[n] for n in ("v_front_V", "v_back_V")}
    with pytest.raises(RecordingError, match="v_front_V reaches") as caught:
        import_log(write(tmp_path, data), PROFILE)
    options = "--map v_front_V=v_front_V/1000 --map v_back_V=v_back_V/1000"
    assert options in caught.value.fix


def test_a_table_in_a_text_file_is_read_as_csv(tmp_path: Path) -> None:
    table = write(tmp_path, csv_text(columns()).replace(",", "\t"), "log.txt")
    np.testing.assert_array_equal(import_log(table, PROFILE).t, flight(1500).t)
    for text in ("step 3, 10 V\nwindy\n", "\0" * 99, ""):
        with pytest.raises(RecordingError, match="is not a log that can be imported"):
            import_log(write(tmp_path, text, "notes.txt"), PROFILE)


def test_rows_that_were_written_twice_are_to_be_removed(tmp_path: Path) -> None:
    def error_of(rows: np.ndarray) -> RecordingError:
        with pytest.raises(RecordingError, match="does not increase at line 302") as caught:
            import_log(write(tmp_path, {n: v[rows] for n, v in columns().items()}), PROFILE)
        return caught.value

    k = np.arange(1500)
    twice, two_logs = error_of(np.r_[k[:300], k[290:]]), error_of(np.r_[k[:300], k[:900]])
    assert twice.cause == "10 rows have the time of another row: they were written twice."
    assert twice.fix == "remove the repeated rows; keep one log per file"
    assert two_logs.cause.startswith("two logs in one file")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (lambda: renamed("v_front_V", "Vfront"), r"no column v_front_V; the nearest is 'Vfront'"),
        (lambda: renamed("t_s", "stamp"), r"no column t_s"),
        (
            lambda: columns() | {"roll_rad": np.deg2rad(columns()["roll_deg"])},
            "has both roll_deg",
        ),
        (
            lambda: columns() | {"yaw_deg": np.append(columns()["yaw_deg"][:900], 600 * [np.nan])},
            r"line 902, column yaw_deg: no number \(and 599 more in this column\)",
        ),
        (lambda: changed("v_back_V", 7, "OL"), "line 9, column v_back_V: 'OL' is not a number"),
        (lambda: swapped_time(99), "does not increase at line 102"),
        (lambda: columns() | {"t_s": np.round(columns()["t_s"], 2)}, "time does not increase"),
        (lambda: columns() | {"t_s": 1000 * columns()["t_s"]}, "steps by 2;"),
        (lambda: columns(2), "has 2 samples"),
        (lambda: columns(1), "has 1 sample; at least 10"),
        (
            lambda: {k: v for k, v in columns().items() if k[:3] in ("t_s", "v_f", "v_b")},
            "no angle",
        ),
        (lambda: columns() | {"v_front_V": 1000 * columns()["v_front_V"]}, "reaches"),
        (lambda: "", "is empty"),
        (lambda: "0,1,1,2\n0.002,1,1,2\n", "no header line"),
        (lambda: "t_s,v_front_V,v_back_V,roll_deg\n", "has 0 samples"),
        (lambda: "t_s,v_front_V,t_s,roll_deg\n0,0,0,0\n", "has two columns t_s"),
        (lambda: "t_s,,v_back_V,roll_deg\n0,0,0,0\n", "column 2 of the header line has no name"),
        (lambda: csv_text(columns()).replace("\n", "\n1,2,3\n", 20), "line 2 has 3 cells"),
        (
            lambda: "t_s,v_front_V,v_back_V,roll_deg\n0,000,1,5,2,5,3,5\n0,002,1,5,2,5,3,5\n",
            "line 2 has 8 cells, the header line 4",
        ),
        (lambda: b"\x89HDF\r\n\x1a\n" + bytes(600), "HDF5"),
    ],
)
def test_an_unusable_log_is_refused_with_its_place(tmp_path: Path, content, message: str) -> None:
    with pytest.raises(RecordingError, match=message) as caught:
        import_log(write(tmp_path, content()), PROFILE)
    assert caught.value.exit_code == 5
    assert caught.value.cause
    assert caught.value.fix


@pytest.mark.parametrize(
    ("content", "what", "fix"),
    [
        (lambda: renamed("t_s", "stamp"), "no column t_s", "--map 't_s=sample/200'"),
        (lambda: columns() | {"t_s": np.arange(1500)}, "whole numbers", "--map t_s=t_s/200"),
        (
            lambda: {k: np.append(v, np.zeros(9)) for k, v in columns().items()},
            r"t_s is 0 from line 1502 to the end \(9 of 1509 samples\)",
            "remove the rows from line 1502 on",
        ),
        (
            lambda: {
                {"t_s": "Zeit [ms]", "v_back_V": "hinten", "v_front_V": "vorne",
                 "roll_deg": "Elevation [°]"}.get(k, k): v for k, v in columns().items()
            },
            "no column t_s, v_front_V, v_back_V",
            "--map 't_s=Zeit [ms]/1000' --map 'roll_deg=Elevation [°]' and a --map for v_front_V, "
            "v_back_V",
        ),
    ],
)  # fmt: skip
def test_the_advice_fits_the_log_and_the_profile(tmp_path: Path, content, what, fix) -> None:
    loop = PROFILE.loop.model_copy(update={"rate_hz": 200.0})
    profile = PROFILE.model_copy(update={"loop": loop})
    with pytest.raises(RecordingError, match=what) as caught:
        import_log(write(tmp_path, content()), profile)
    assert fix in str(caught.value.fix)


def numbered(first: int = 0, step: int = 1) -> str:
    head, *rows = csv_text(columns()).splitlines()
    lines = [f",{head}", *(f"{first + step * k},{row}" for k, row in enumerate(rows))]
    return "\n".join(lines) + "\n"


def test_an_unnamed_first_column_of_row_numbers_is_ignored(tmp_path: Path) -> None:
    table = read_log(write(tmp_path, numbered()), PROFILE)
    assert table.columns.keys() == columns().keys()
    assert "numbers the rows" in table.notes[0]
    with pytest.raises(RecordingError, match="column 1 of the header line has no name"):
        import_log(write(tmp_path, numbered(step=5)), PROFILE)


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_dates_with_times_become_seconds(tmp_path: Path, zone: str) -> None:
    start = datetime(2026, 5, 4, 23, 59, 59)
    t = [timedelta(seconds=float(x)) for x in columns()["t_s"]]
    table = read_log(
        write(tmp_path, columns() | {"t_s": [f"{start + x}{zone}" for x in t]}), PROFILE
    )
    np.testing.assert_allclose(table.columns["t_s"], flight(1500).t, atol=1e-6)
    assert "t_s contains dates" in table.notes[0]


def test_rounded_times_are_computed_from_the_sample_number(tmp_path: Path) -> None:
    rounded = columns() | {"t_s": np.round(columns()["t_s"], 2)}
    with pytest.raises(RecordingError) as caught:
        import_log(write(tmp_path, rounded), PROFILE)
    assert caught.value.fix.startswith("heli3dof import … --map t_s=sample/500, if no sample is")


def test_decimal_commas_in_a_comma_table_are_named_as_the_cause(tmp_path: Path) -> None:
    text = "t_s,v_front_V,v_back_V,roll_deg\n0,000,1,5,2,5,3,5\n0,002,1,5,2,5,3,5\n"
    with pytest.raises(RecordingError) as caught:
        import_log(write(tmp_path, text), PROFILE)
    assert "decimal commas" in caught.value.cause


def test_a_separator_unlike_the_headers_is_named_as_the_cause(tmp_path: Path) -> None:
    text = "t_s,v_front_V,v_back_V,roll_deg\n0 1 2 3\n0.002 1 2 3\n"
    with pytest.raises(RecordingError, match="line 2 has 1 cell, the header line 4") as caught:
        import_log(write(tmp_path, text), PROFILE)
    assert "separated by spaces, the header's by commas" in caught.value.cause


def gappy() -> dict[str, Any]:
    keep = np.ones(1500, bool)
    keep[100:110] = keep[700] = False
    return {name: v[keep] for name, v in columns().items()}


def jittery() -> dict[str, Any]:
    rng = np.random.default_rng(1)
    return columns() | {"t_s": columns()["t_s"] + rng.uniform(-2e-4, 2e-4, 1500)}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            gappy,
            "2 gaps in time (0.73 % of the samples are missing, the longest interval "
            "between samples is 0.022 s)",
        ),
        (jittery, "Sampling jitter: the intervals between samples scatter"),
        (lambda: columns() | {"t_s": 2 * columns()["t_s"]}, "Sampled at 250 Hz"),
        (
            lambda: columns() | {"v_front_V": np.full(1500, 3.0), "v_back_V": np.full(1500, 3.0)},
            "The input is constant",
        ),
        (lambda: columns() | {"v_front_V": columns()["v_front_V"] + 20}, "beyond the profile's"),
        (lambda: columns() | {"yaw_deg": np.full(1500, 1.0)}, "yaw_deg never changes"),
        (lambda: columns() | {"mode": ["auto"] * 1500}, "column mode holds text"),
        (lambda: columns() | {"yaw_deg": [""] * 1500}, "column yaw_deg is empty"),
        (
            lambda: {k: v for k, v in columns().items() if k != "v_back_cmd_V"},
            "Only one of the two columns v_*_cmd_V",
        ),
        (lambda: csv_text(columns())[:-30], "is incomplete and was ignored"),
    ],
)
def test_warnings_are_stored_in_the_recording(tmp_path: Path, content, message: str) -> None:
    path = write(tmp_path, content())
    assert warned(path, message)
    stored = load(write_recording(import_log(path, PROFILE), tmp_path / "a.mcap"))
    assert any(message in w for w in stored.meta["warnings"])


MAT_NAMES = ("t_s", "v_front_V", "v_back_V", "roll_deg", "pitch_deg", "yaw_deg")


def matrix(n: int = 500) -> np.ndarray:
    data = columns(n)
    return np.column_stack([data[name] for name in MAT_NAMES])


@pytest.mark.parametrize("transpose", [False, True])
def test_columns_name_the_rows_or_columns_of_a_matrix(tmp_path: Path, transpose: bool) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {"data": matrix().T if transpose else matrix(), "fs": 500.0})
    r = import_log(path, PROFILE, columns=",".join(MAT_NAMES))
    np.testing.assert_allclose(r.angle, flight(500).angle, atol=1e-12)
    short = import_log(path, PROFILE, columns="t_s,v_front_V,v_back_V,roll_deg,-,-")
    assert short.axes == ("roll",)


def test_named_vectors_and_structures_need_no_columns_option(tmp_path: Path) -> None:
    vectors = {name: matrix()[:, i] for i, name in enumerate(MAT_NAMES)}
    savemat(tmp_path / "a.mat", {**vectors, "gust": vectors["t_s"] * 2, "note": "windy", "g": 9.81})
    savemat(tmp_path / "b.mat", {"log": vectors}, oned_as="column")
    a, b = (import_log(tmp_path / name, PROFILE) for name in ("a.mat", "b.mat"))
    assert a.digest == b.digest
    assert list(a.channels) == ["gust"]


def test_ambiguous_mat_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {"data": matrix()})
    with pytest.raises(RecordingError, match="no column v_front_V, v_back_V") as caught:
        import_log(path, PROFILE)
    assert r"data[1], data[2], data[3]" in caught.value.cause
    assert "--map" in caught.value.fix
    with pytest.raises(RecordingError, match="names 4 columns, but no matrix"):
        import_log(path, PROFILE, columns="t_s,v_front_V,v_back_V,roll_deg")
    savemat(path, {"one": matrix(), "two": matrix()})
    with pytest.raises(RecordingError, match="several matrices of that size"):
        import_log(path, PROFILE, columns=",".join(MAT_NAMES))
    assert len(import_log(path, PROFILE, columns="two:" + ",".join(MAT_NAMES))) == 500
    with pytest.raises(UsageError, match="names t_s twice"):
        import_log(path, PROFILE, columns="two:t_s,t_s,v_front_V,v_back_V,roll_deg,pitch_deg")
    savemat(path, {"t_s": np.arange(20.0), "v_front_V": np.ones(19), "v_back_V": np.ones(20)})
    with pytest.raises(RecordingError, match="different lengths"):
        import_log(path, PROFILE)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"MATLAB 7.3 MAT-file" + bytes(493) + b"\x89HDF\r\n\x1a\n", "version 7.3"),
        (b"t_s,v_front_V,v_back_V\n1,2,3\n", "CSV"),
        (b"MATLAB 5.0 MAT-file" + bytes(300), "not a readable MAT-file"),
        (b"", "an empty file"),
    ],
)
def test_a_file_that_is_no_mat_file_is_described(
    tmp_path: Path, content: bytes, message: str
) -> None:
    with pytest.raises(RecordingError, match=message):
        import_log(write(tmp_path, content, "log.mat"), PROFILE)


def test_a_log_needs_a_profile_and_a_recording_contains_one(tmp_path: Path) -> None:
    path = write(tmp_path, columns())
    with pytest.raises(UsageError, match="does not contain the rig's profile") as caught:
        load(path)
    assert "--profile" in caught.value.fix
    stored = write_recording(load(path, PROFILE), tmp_path / "a.mcap")
    assert load(stored).digest == load(path, PROFILE).digest
    other = open_profile(motor={"V_o": 3.0})
    assert load(stored, other).profile.motor.V_o == 3.0
    with pytest.raises(RecordingError, match="There is no recording"):
        load(tmp_path / "nothing.csv")
    with pytest.raises(UsageError, match="columns is for MAT"):
        load(path, PROFILE, columns="t_s")
    with pytest.raises(RecordingError, match="not an MCAP recording; it is a text table"):
        load(write(tmp_path, columns(), "log.dat"), PROFILE)


def real_logs() -> list[Path]:
    return sorted(REAL_DATA.glob("rig-*/*.csv")) if REAL_DATA.is_dir() else []


@needs_real_data
@pytest.mark.real_data
@pytest.mark.parametrize("path", real_logs(), ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_every_real_log_imports_with_jitter_warnings_for_rig_a_only(
    path: Path, tmp_path: Path
) -> None:
    r = import_log(path, load_profile(path.parent / "profile.toml"))
    bursts = path.parent.name == "rig-a" and path.stem.startswith("closed")
    assert ["Hidden sampling jitter" in w for w in r.meta["warnings"]] == [True] * bursts
    if path.stem.startswith("closed"):
        assert r.axes == ("roll", "pitch", "yaw")
        assert r.has_cmd
    else:
        assert r.axes == (path.stem.split("-")[1],)
        assert not r.has_cmd
    stored = load(write_recording(r, tmp_path / "a.mcap"))
    assert stored.digest == r.digest
    assert not stored.profile.controller_is_known
