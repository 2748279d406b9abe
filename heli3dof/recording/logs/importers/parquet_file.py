"""Importer of Parquet logs (``.parquet``), which need pyarrow; one column per signal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.results import optional
from heli3dof.rig.profile import Profile


def read(
    path: Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> Table:
    """Return the numeric columns of a Parquet log; ``profile`` and ``columns`` are not used.

    Raises UsageError if pyarrow is missing.
    """
    optional("pyarrow", extra="parquet")
    from pyarrow import parquet

    table = parquet.read_table(path)
    arrays = {n: table[n].to_numpy() for n in table.column_names}
    numeric = {name: a for name, a in arrays.items() if np.issubdtype(a.dtype, np.number)}
    ignored = [f"{name}: not numeric" for name in arrays.keys() - numeric.keys()]
    return Table(path.name, numeric, lambda k: f"row {k + 1}", ignored=ignored)


IMPORTER = Importer("Parquet", (".parquet",), read)
