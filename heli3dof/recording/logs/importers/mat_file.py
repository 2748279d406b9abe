"""Importer of MAT logs: named vectors, or a matrix whose rows or columns ``--columns`` names.

scipy reads versions 4 to 7. For version 7.3 (HDF5), the error contains the command to convert it.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.columns import KNOWN, REQUIRED
from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.mcap_files.mcap_scan import read_bytes, what_is
from heli3dof.rig.profile import Profile

HDF5 = b"\x89HDF\r\n\x1a\n"
SKIP = {"", "-", "_"}
"""Names in ``--columns`` for rows or columns to skip"""


def read(
    path: Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> Table:
    """Return the columns of a MAT log.

    ``columns`` names the matrix's rows or columns in order: ``t_s,v_front_V,…``; the name ``-``
    skips a row or column. ``log:t_s,v_front_V,…`` takes the matrix from the variable ``log``.
    Without ``columns``, the variables or the fields of a structure must have the columns' names.
    Raises RecordingError or UsageError.
    """
    variables = _load(path)
    table = _structures(variables)
    wanted, names = _parse(columns)
    if names is None:
        vectors = _vectors(table)
        if not set(REQUIRED) & vectors.keys():
            raise RecordingError(
                f"{path}: no variable has a column name of a log. It contains "
                f"{_listed(variables)}.",
                cause="the log is a matrix, whose rows or columns have no names.",
                fix=f"heli3dof import {path} --columns t_s,v_front_V,v_back_V,roll_deg,… …",
            )
        return _table(path, vectors)
    matrix = _matrix(path, table, wanted, len(names))
    if matrix.shape[1] != len(names):
        matrix = matrix.T
    kept = [name for name in names if name not in SKIP]
    twice = next((name for name in kept if kept.count(name) > 1), None)
    if twice is not None:
        raise UsageError(
            f"--columns names {twice} twice.",
            cause="a typing error.",
            fix="write - for a column to skip",
        )
    return _table(path, {name: matrix[:, i] for i, name in enumerate(names) if name not in SKIP})


def _load(path: Path) -> dict[str, Any]:
    data = read_bytes(path)
    if data.startswith((b"MATLAB 7.3", HDF5)) or data[512:520] == HDF5:
        raise RecordingError(
            f"{path} is a MAT-file of version 7.3 (HDF5), which is not supported.",
            cause="it was saved with -v7.3, or MATLAB's preferences select that version.",
            fix="in MATLAB: S = load('log.mat'); save('log.mat', '-struct', 'S', '-v7')",
        )
    from scipy.io import loadmat

    try:
        found: dict[str, Any] = loadmat(io.BytesIO(data))  # type: ignore[arg-type]
    except Exception as error:  # damaged bytes make scipy raise anything
        raise RecordingError(
            f"{path} is not a readable MAT-file; it is {what_is(data)} ({error}).",
            cause="an incomplete copy, or another kind of file.",
            fix="save it again with save('log.mat', '-v7'), or export the log as CSV",
        ) from error
    return {k: v for k, v in found.items() if not k.startswith("__")}


def _structures(variables: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return a MAT file's arrays by name; a structure gives one array for each of its fields."""
    table: dict[str, np.ndarray] = {}
    for name, value in variables.items():
        if isinstance(value, np.ndarray) and value.dtype.names and value.size == 1:
            for field in value.dtype.names:
                table.setdefault(field, np.asarray(value.flat[0][field]))
        elif isinstance(value, np.ndarray):
            table[name] = value
    return table


def _vectors(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    found = {
        name: np.asarray(value, dtype=float).ravel()
        for name, value in table.items()
        if value.dtype.kind in "fiub" and value.size == max(value.shape, default=0)
    }
    n = len(found["t_s"]) if "t_s" in found else None
    return {k: v for k, v in found.items() if k in KNOWN or len(v) == n}


def _parse(columns: str | Sequence[str] | None) -> tuple[str | None, list[str] | None]:
    if columns is None:
        return None, None
    text = columns if isinstance(columns, str) else ",".join(columns)
    variable, colon, rest = text.rpartition(":")
    return (variable.strip() if colon else None), [name.strip() for name in rest.split(",")]


def _matrix(path: Path, table: dict[str, np.ndarray], wanted: str | None, count: int) -> np.ndarray:
    matrices = {
        name: value
        for name, value in table.items()
        if value.dtype.kind in "fiub" and value.ndim == 2 and min(value.shape) > 1
    }
    fitting = {name: value for name, value in matrices.items() if count in value.shape}
    if wanted is not None:
        fitting = {name: value for name, value in fitting.items() if name == wanted}
    if len(fitting) == 1:
        return np.asarray(next(iter(fitting.values())), dtype=float)
    if not fitting:
        raise RecordingError(
            f"{path}: --columns names {count} columns, but no matrix"
            f"{'' if wanted is None else f' {wanted!r}'} has {count} rows or columns. "
            f"It contains {_listed(table)}.",
            cause="a name is missing or extra.",
            fix="name every row or column of the matrix in order, - for one to skip",
        )
    raise RecordingError(
        f"{path} has several matrices of that size: {_listed(fitting)}.",
        cause="several logs in one file.",
        fix=f"name one: --columns {next(iter(fitting))}:t_s,v_front_V,…",
    )


def _table(path: Path, columns: dict[str, np.ndarray]) -> Table:
    lengths = {name: len(values) for name, values in columns.items()}
    if len(set(lengths.values())) > 1:
        raise RecordingError(
            f"{path}: the columns have different lengths: "
            + ", ".join(f"{name} {n}" for name, n in lengths.items())
            + ".",
            cause="the signals were logged at different rates.",
            fix="log all of them at the control rate",
        )
    plain = {name: np.ascontiguousarray(v, dtype=float) for name, v in columns.items()}
    return Table(path.name, plain, lambda k: f"sample {k + 1}")


def _listed(variables: dict[str, Any]) -> str:
    shapes = (
        f"{name} ({' × '.join(map(str, np.shape(value)))})" for name, value in variables.items()
    )
    return ", ".join(shapes) or "nothing"


IMPORTER = Importer("MAT", (".mat",), read)
