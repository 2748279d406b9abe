"""The results table as CSV and Parquet: one row per task (recording, replicate or swept flight).

A column has one type: 64-bit integer, 64-bit floating-point number, boolean or text. Missing values
are empty. The columns are in the order in which they first appear in the rows.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from heli3dof.errors import RecordingError, UsageError, quoted
from heli3dof.recording.atomic_write import write_file

CSV, PARQUET = "results.csv", "results.parquet"
TEXTS = (
    "recording", "name", "rig", "serial", "started_utc", "plan", "outcome", "error", "faults",
    "digest", "absent",
)  # fmt: skip
"""Columns whose values stay text even if they look like numbers, such as the rig name 7"""
Row = Mapping[str, Any]


def write_table(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Write the rows to ``folder`` as CSV and, with pyarrow, as Parquet; return the paths.

    An earlier table is replaced. Raises NoSpace or UsageError if the table cannot be written.
    """
    columns = typed(rows)
    written = [write_file(folder / CSV, csv_bytes(columns), force=True)]
    if (parquet := parquet_bytes(columns)) is not None:
        written.insert(0, write_file(folder / PARQUET, parquet, force=True))
    return written


def typed(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """Return column → values of one type, None where a row has no value.

    Integers become floats in a column with floats; any other mixture of types becomes text.

    >>> typed([{"a": 1}, {"a": 0.5, "b": "x"}])
    {'a': [1.0, 0.5], 'b': [None, 'x']}
    """
    names = dict.fromkeys(name for row in rows for name in row)
    return {name: _one_type([row.get(name) for row in rows]) for name in names}


def _one_type(values: list[Any]) -> list[Any]:
    values = [None if isinstance(v, float) and not math.isfinite(v) else v for v in values]
    types = {type(v) for v in values} - {type(None)}
    if len(types) <= 1:
        return values
    convert = float if types == {int, float} else str
    return [None if v is None else convert(v) for v in values]


def csv_bytes(columns: Mapping[str, Sequence[Any]]) -> bytes:
    """Return the table as CSV in UTF-8; each number has the fewest digits that restore it."""
    stream = io.StringIO(newline="")
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    return stream.getvalue().encode("utf-8", "backslashreplace")


def parquet_bytes(columns: Mapping[str, Sequence[Any]]) -> bytes | None:
    """Return the table as a Parquet file, or None if pyarrow is not installed."""
    try:
        import pyarrow as pa
        from pyarrow import parquet
    except ModuleNotFoundError:
        return None
    kinds = {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    arrays = {}
    for name, values in columns.items():
        kind = next((type(v) for v in values if v is not None), str)
        arrays[name] = pa.array(values, kinds.get(kind, pa.string()))
    sink = io.BytesIO()
    parquet.write_table(pa.table(arrays), sink, compression="zstd")
    return sink.getvalue()


def read_rows(folder: Path, *, needed: Sequence[str] = ()) -> list[dict[str, Any]]:
    """Return the rows of results.csv in ``folder``: numbers as float, missing values as None.

    Raises UsageError if there is no such file, RecordingError if it is not a CSV file. With
    ``needed``, also raises RecordingError if one of these columns is missing, or if no row exists.
    """
    path = folder / CSV
    if not path.is_file():
        raise UsageError(
            f"There is no {CSV} in {folder}." if folder.is_dir()
            else f"There is no folder {folder}.",
            cause="no batch has written its results there, or a typing error in the path.",
            fix=f"heli3dof batch identify REC... -o {quoted(folder)}",
        )  # fmt: skip
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.DictReader(stream, restkey="")
            rows, columns = list(reader), reader.fieldnames or []
    except (UnicodeDecodeError, csv.Error) as error:
        raise _unusable(path, str(error)) from error
    if missing := [column for column in needed if column not in columns]:
        raise RecordingError(
            f"{path} cannot be used: the column {missing[0]} is missing.",
            cause="the table of batch identify is needed. Another verb, such as batch run, or "
            "another program wrote this one.",
            fix="heli3dof batch identify REC... -o FOLDER",
        )
    if needed and not rows:
        raise _unusable(path, "it has no rows")
    return [{k: _value(k, v) for k, v in row.items() if k} for row in rows]


def _unusable(path: Path, why: str) -> RecordingError:
    return RecordingError(
        f"{path} cannot be used: {why}.",
        cause="another program wrote the file, or the batch was interrupted.",
        fix=f"heli3dof batch identify REC... -o {quoted(path.parent)}",
    )


def _value(column: str, text: str | None) -> Any:
    if text is None or not text.strip():
        return None
    if column in TEXTS:
        return text
    if text in ("True", "False"):
        return text == "True"
    try:
        return float(text)
    except ValueError:
        return text
