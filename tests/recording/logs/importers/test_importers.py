"""A new log format is one file, or one entry point of another package."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest

from heli3dof import plugins
from heli3dof.errors import RecordingError
from heli3dof.recording import atomic_write
from heli3dof.recording.info import file_info
from heli3dof.recording.load import load
from heli3dof.recording.logs import importers
from heli3dof.recording.logs.export import export
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.write import write_recording
from tests.recording.make import flight, open_profile

NPY = Importer(
    "NPY",
    (".npy",),
    lambda path, profile, columns: Table(
        path.name,
        dict(zip(("t_s", "v_front_V", "v_back_V", "roll_rad"), np.load(path), strict=True)),
        lambda k: f"sample {k + 1}",
    ),
)


@pytest.fixture
def plug_ins(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    points = [
        EntryPoint("npy", f"{__name__}:NPY", importers.GROUP),
        EntryPoint("dialect", f"{__name__}:DIALECT", importers.GROUP),
        EntryPoint("broken", "no_such_package:IMPORTER", importers.GROUP),
        EntryPoint("wrong", "json:loads", importers.GROUP),
    ]
    monkeypatch.setattr(plugins, "entry_points", lambda group: points)
    importers.importers.cache_clear()
    yield
    importers.importers.cache_clear()


def test_the_formats_in_the_folder_are_found() -> None:
    assert {"CSV", "MAT", "MCAP"} <= {i.name for i in importers.importers()}
    lengths = [len(ending) for ending in importers.endings()]
    assert lengths == sorted(lengths, reverse=True)


def test_another_packages_format_is_loaded_and_described(
    tmp_path: Path, plug_ins: None, caplog: pytest.LogCaptureFixture
) -> None:
    made = flight(500)
    path = tmp_path / "a.npy"
    np.save(path, [made.t, made.voltage[:, 0], made.voltage[:, 1], made.angle[:, 0]])
    read = load(path, open_profile())
    np.testing.assert_array_equal(read.angle[:, 0], made.angle[:, 0])
    assert file_info(path, open_profile())["samples"] == 500
    assert atomic_write.stem(path) == "a"
    assert "importer broken (no_such_package:IMPORTER) does not load" in caplog.text
    assert "importer wrong (json:loads) does not load: TypeError: it is a function" in caplog.text


DIALECT = Importer("DIALECT", (".CSV",), NPY.read, recognises=lambda path: "lab" in path.name)


def test_an_importer_that_recognises_a_dialect_comes_first(plug_ins: None) -> None:
    assert importers.importer_of("lab.csv") is DIALECT
    assert [importer.name for importer in importers.importers()][-1] == "NPY"
    other = importers.importer_of("other.csv")
    assert other is not None
    assert other.name == "CSV"
    assert DIALECT.endings == (".csv",)


def test_a_single_ending_without_comma_is_refused() -> None:
    with pytest.raises(TypeError, match="a single one needs a comma"):
        Importer("LAB", ".lab", NPY.read)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "format_"),
    [("a.CSV", "CSV"), ("a.csv.gz", "CSV"), ("a.mat", "MAT"), ("a.mcap", None), ("a.txt", None)],
)
def test_a_name_that_does_not_exist_is_recognised_by_its_ending(
    name: str, format_: str | None
) -> None:
    importer = importers.importer_of(name)
    assert (importer.name if importer else None) == format_


def test_a_recording_of_heli3dof_needs_no_importer(tmp_path: Path) -> None:
    path = write_recording(flight(50), tmp_path / "a.mcap")
    assert importers.importer_of(path) is None
    assert importers.importer_of(export(flight(50), tmp_path / "a.csv")) is not None


def _two_lengths(path: Path) -> Table:
    return Table(path.name, {"t_s": np.zeros(2), "v_front_V": np.zeros(3)}, str)


def _text(path: Path) -> Table:
    return Table(path.name, {"t_s": np.zeros(2), "note": np.array(["a", "b"])}, str)


def _matrix(path: Path) -> Table:
    return Table(path.name, {"t_s": np.zeros((2, 2))}, str)


def _empty(path: Path) -> Table:
    return Table(path.name, {}, str)


def _exit(path: Path) -> Table:
    raise SystemExit(3)


def _no_table(path: Path) -> Table:
    return json.loads("{}")  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("read", "says"),
    [
        (lambda path: json.loads("{"), "JSONDecodeError"),
        (lambda path: {}["t_s"], "KeyError: 't_s'"),
        (lambda path: [][0], "IndexError"),
        (lambda path: struct.unpack("<d", b"1234"), "error: unpack requires"),
        (lambda path: b"\xff".decode("utf-8"), "UnicodeDecodeError"),
        (lambda path: next(iter(())), "StopIteration"),
        (_two_lengths, "ValueError: its columns have different shapes: {'t_s': (2,)"),
        (_text, "ValueError: its column note contains no numbers: could not convert string"),
        (_matrix, "ValueError: its columns are not vectors: {'t_s': (2, 2)}"),
        (_empty, "ValueError: its table has no column"),
        (_exit, "SystemExit: 3"),
        (_no_table, "TypeError: it is a dict; expected: Table"),
    ],
)
def test_any_exception_of_an_importer_names_the_file_and_the_importer(
    read: Callable[[Path], Table], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = Importer("LAB", (".lab",), lambda path, profile, columns: read(path))
    monkeypatch.setattr(importers, "importers", lambda: (broken,))
    path = tmp_path / "a.lab"
    path.write_bytes(b"torn")
    with pytest.raises(RecordingError) as caught:
        load(path, open_profile())
    assert f"{path} cannot be read by the importer LAB: " in caught.value.what
    assert says in caught.value.what
    assert caught.value.cause
    assert caught.value.fix


def test_a_bug_in_the_positions_of_an_importer_names_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(path: Path, profile: object, columns: object) -> Table:
        return replace(NPY.read(path, None, None), where=lambda k: str([][k]))

    monkeypatch.setattr(importers, "importers", lambda: (Importer("LAB", (".npy",), read),))
    path = tmp_path / "a.npy"
    made = flight(500)
    np.save(path, [made.t * np.nan, made.voltage[:, 0], made.voltage[:, 1], made.angle[:, 0]])
    with pytest.raises(RecordingError, match="of the importer LAB failed: IndexError") as caught:
        load(path, open_profile())
    assert f"its package, tests ({__file__}:" in caught.value.cause


def test_an_importer_that_cannot_examine_a_file_leaves_it_to_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def magic(path: Path) -> bool:
        return bool(struct.unpack("<d", path.read_bytes()[:3]))

    lab = Importer("LAB", (".lab",), NPY.read, recognises=magic)
    monkeypatch.setattr(importers, "importers", lambda: (lab, NPY))
    path = tmp_path / "a.npy"
    assert importers.importer_of(path) is NPY  # it does not exist
    assert not caplog.text
    path.write_bytes(b"torn")
    assert importers.importer_of(path) is NPY
    assert f"the importer LAB cannot examine {path}: error: unpack requires" in caplog.text


@pytest.mark.parametrize("name", ["log.npz", "log.parquet"])
def test_numpy_and_parquet_logs_are_read(tmp_path: Path, name: str) -> None:
    made, path = flight(500), tmp_path / name
    if name == "log.parquet":
        pytest.importorskip("pyarrow")
        export(made, path)
    else:
        columns = {"t_s": made.t, "v_front_V": made.voltage[:, 0], "v_back_V": made.voltage[:, 1]}
        np.savez(path, **columns, roll_rad=made.angle[:, 0])
    read = load(path, open_profile())
    np.testing.assert_allclose(read.angle[:, 0], made.angle[:, 0], atol=1e-12)
    np.testing.assert_array_equal(read.voltage, made.voltage)


def test_other_formats_name_those_that_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "log.xlsx"
    path.write_bytes(b"PK\x03\x04 a spreadsheet")
    for read in (lambda: load(path), lambda: import_log(path, open_profile())):
        with pytest.raises(RecordingError) as caught:
            read()
        every = sorted(importers.endings())
        assert {".csv", ".csv.gz", ".mat", ".mcap", ".npz", ".parquet"} <= {*every}
        assert ", ".join(every) in str(caught.value)
        assert "ls " not in caught.value.fix
