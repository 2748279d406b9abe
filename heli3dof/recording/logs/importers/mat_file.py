"""Importer of MAT logs: vectors, matrices, structures with time.

`heli3dof.recording.logs.matlab` finds the signals. ``--columns`` can name the rows or columns of a
matrix.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.atomic_write import stem
from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.logs.joined_tables import join
from heli3dof.recording.logs.matlab.signals import tables
from heli3dof.recording.logs.matlab.variables import read_variables
from heli3dof.rig.profile import Profile

SKIP = {"", "-", "_"}
"""Names in ``--columns`` for rows or columns to skip"""


def read(
    path: Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> Table:
    """Return the columns of a MAT log.

    ``columns`` names the rows or columns of a matrix in order: ``t_s,v_front_V,…``; the name ``-``
    skips a row or column. ``log:t_s,v_front_V,…`` takes the matrix from the variable ``log``.
    Without ``columns``, the signals have the names of `heli3dof.recording.logs.matlab.signals`.
    Raises RecordingError if the file contains no such signals or is not readable, UsageError if
    ``columns`` repeats a name or h5py is missing.
    """
    return table_of(path, read_variables(path), columns)


def table_of(
    path: Path, variables: Mapping[str, Any], columns: str | Sequence[str] | None
) -> Table:
    """Return the columns of the file at ``path``, which has these ``variables``; see `read`."""
    wanted, names = _parse(columns)
    if names is None:
        return join(tables_of(path, variables))
    table = _arrays(variables)
    matrix = _matrix(path, table, wanted, len(names))
    if matrix.shape[1] != len(names):
        matrix = matrix.T
    kept = [name for name in names if name not in SKIP]
    twice = next((name for name in kept if kept.count(name) > 1), None)
    if twice is not None:
        raise UsageError(
            f"columns names {twice} twice.",
            cause="a typing error.",
            fix="write - for a column to skip",
        )
    kept_columns = {
        name: np.ascontiguousarray(matrix[:, i], dtype=float)
        for i, name in enumerate(names)
        if name not in SKIP
    }
    return Table(path.name, kept_columns, lambda k: f"sample {k + 1}")


def tables_of(path: Path, variables: Mapping[str, Any]) -> list[Table]:
    """Return the signals of a MAT file: one table for each time vector in the file.

    ``variables``: the variables of the file at ``path``, by name. Arrays without a time vector form
    one table per array length. Raises RecordingError if the file contains no signals.
    """
    found = tables(path.name, stem(path), variables)
    if not found:
        raise RecordingError(
            f"{path} contains no signals. It contains {_listed(variables)}.",
            cause="the log is empty, or a format that only MATLAB can read.",
            fix="in MATLAB, save time and signals as plain vectors: save('log.mat', 't', …)",
        )
    return found


def _read_tables(path: Path) -> list[Table]:
    return tables_of(path, read_variables(path))


def _arrays(variables: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return a MAT file's arrays by name; each field of a structure is an array of its own."""
    table: dict[str, np.ndarray] = {}
    for name, value in variables.items():
        fields = value if isinstance(value, Mapping) else {name: value}
        for field, inner in fields.items():
            if isinstance(inner, np.ndarray):
                table.setdefault(field, inner)
    return table


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
            f"{path}: columns names {count} columns, but no matrix"
            f"{'' if wanted is None else f' {wanted!r}'} has {count} rows or columns. "
            f"It contains {_listed(table)}.",
            cause="a name is missing or extra.",
            fix="name every row or column of the matrix in order, - for one to skip",
        )
    raise RecordingError(
        f"{path} has several matrices of that size: {_listed(fitting)}.",
        cause="several logs in one file.",
        fix=f"name one: columns='{next(iter(fitting))}:t_s,v_front_V,…'",
    )


def _listed(variables: Mapping[str, Any]) -> str:
    shapes = (
        f"{name} ({' × '.join(map(str, np.shape(value)))})" for name, value in variables.items()
    )
    return ", ".join(shapes) or "nothing"


IMPORTER = Importer("MAT", (".mat",), read, read_tables=_read_tables)
