"""Importer of NumPy logs (``.npz``), which reads their arrays like the variables of a MAT file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.logs.importers.mat_file import table_of, tables_of
from heli3dof.rig.profile import Profile


def read(
    path: Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> Table:
    """Return the columns of a NumPy log; ``columns`` has the same meaning as in `mat_file.read`."""
    with np.load(path) as arrays:
        return table_of(path, dict(arrays), columns)


def _read_tables(path: Path) -> list[Table]:
    with np.load(path) as arrays:
        return tables_of(path, dict(arrays))


IMPORTER = Importer("NumPy", (".npz",), read, read_tables=_read_tables)
