"""The results table as CSV and Parquet."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from heli3dof.batch.results_table import read_rows, typed, write_table
from heli3dof.errors import RecordingError, UsageError
from tests.paths import ROOT

ROWS = [
    {"recording": "a.mcap", "rig": "7", "exit_code": 0, "T_g": 1.25, "torn": False},
    {"recording": "b.mcap", "rig": "K2", "exit_code": 5, "error": 'says "no", twice'},
]


def test_pandas_polars_and_duckdb_read_the_same_table(tmp_path: Path) -> None:
    pandas, polars, duckdb = map(pytest.importorskip, ("pandas", "polars", "duckdb"))
    parquet = write_table(ROWS, tmp_path)[0]
    expected = [(0, 1.25, "7", None), (5, None, "K2", 'says "no", twice')]
    columns = ["exit_code", "T_g", "rig", "error"]
    assert polars.read_parquet(parquet).select(columns).rows() == expected
    query = f"select {', '.join(columns)} from '{parquet}'"
    assert duckdb.sql(query).fetchall() == expected
    frame = pandas.read_parquet(parquet)
    assert frame["exit_code"].tolist() == [0, 5]
    assert frame["T_g"][0] == 1.25
    assert math.isnan(frame["T_g"][1])
    assert frame["torn"][0] == False  # noqa: E712


def test_the_csv_file_gives_the_rows_back(tmp_path: Path) -> None:
    write_table(ROWS, tmp_path)
    first, second = read_rows(tmp_path)
    assert first["rig"] == "7"
    assert first["T_g"] == 1.25
    assert first["torn"] is False
    assert second["error"] == 'says "no", twice'
    assert second["T_g"] is None


@given(st.lists(st.fixed_dictionaries({"x": st.floats(allow_nan=False, allow_infinity=False)})))
def test_numbers_keep_every_digit(tmp_path_factory, rows) -> None:
    folder = tmp_path_factory.mktemp("table")
    write_table(rows, folder)
    assert [row["x"] for row in read_rows(folder)] == [row["x"] for row in rows]


def test_the_bytes_depend_on_the_rows_alone(tmp_path: Path) -> None:
    written = [p.read_bytes() for p in write_table(ROWS, tmp_path)]
    assert [p.read_bytes() for p in write_table(ROWS, tmp_path)] == written


def test_a_column_has_one_type() -> None:
    rows = [{"n": 1, "x": 1, "s": 1}, {"n": 2, "x": 0.5, "s": "a"}, {"x": math.nan}]
    assert typed(rows) == {"n": [1, 2, None], "x": [1.0, 0.5, None], "s": ["1", "a", None]}


def test_a_missing_or_damaged_table_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"There is no results\.csv"):
        read_rows(tmp_path)
    (tmp_path / "results.csv").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(RecordingError, match="cannot be used"):
        read_rows(tmp_path)


def test_partitions_are_one_table_for_duckdb(tmp_path: Path) -> None:
    """The query of docs/explanation/scale.md; the partitions have different columns."""
    duckdb = pytest.importorskip("duckdb")
    for lab, rows in {
        "north": [{"recording": "a", "thrust_gain_ratio": 0.9}],
        "south": [{"recording": "b", "lag": 0.1, "thrust_gain_ratio": 1.1}],
    }.items():
        folder = tmp_path / "results" / "term=2026-1" / f"lab={lab}"
        folder.mkdir(parents=True)
        write_table(rows, folder)
    page = (ROOT / "docs" / "explanation" / "scale.md").read_text(encoding="utf-8")
    query = page.partition("```sql\n")[2].partition("```")[0]
    query = query.replace("'results/", f"'{tmp_path}/results/")
    assert sorted(duckdb.sql(query).fetchall()) == [
        ("north", "2026-1", 0.9), ("south", "2026-1", 1.1),
    ]  # fmt: skip
