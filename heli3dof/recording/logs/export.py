"""`export`: writes a `Recording` as a table (CSV, MAT, Parquet) or for a viewer.

In tables, angles are in degrees, and numbers have all their digits. Importing a CSV or MAT file
again restores the arrays with an error of at most 1e-12 (s, V, rad). MAT and Parquet files also
contain the profile and the provenance. `heli3dof.recording.viewers` encodes the files for viewers.
"""

from __future__ import annotations

import csv
import gzip
import io
import re
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np

from heli3dof.errors import UsageError, quoted
from heli3dof.recording.atomic_write import check_outputs, write_file
from heli3dof.recording.columns import export_columns
from heli3dof.recording.mcap_files.mcap_writer import to_json
from heli3dof.recording.recording import Recording, check_samples
from heli3dof.recording.viewers.foxglove_file import foxglove_bytes
from heli3dof.recording.viewers.rerun_file import rrd_bytes

Columns = dict[str, np.ndarray]


def export(recording: Recording, path: str | Path, *, force: bool = False) -> Path:
    """Write a recording in the format that the file name's ending states; return the path.

    Raises OutputExists (without ``force``), UsageError (unknown ending; the library for Parquet or
    Rerun is not installed), NoSpace, or RecordingError if the recording has no samples.
    """
    check_samples(recording)
    path = Path(path)
    check_outputs(path, force=force)
    check_format(path)
    write = next(w for ending, w in FORMATS.items() if path.name.lower().endswith(ending))
    return write_file(path, write(recording, export_columns(recording)), force=force)


def check_format(path: Path) -> None:
    """Raise UsageError unless the file name has one of the endings of `FORMATS`."""
    if not path.name.lower().endswith(tuple(FORMATS)):
        ending = path.suffix or path.name
        first, *others = FORMATS
        raise UsageError(
            f"There is no export format {ending!r}.",
            cause="the ending of the file's name selects the format.",
            fix=f"-o {quoted(path.stem)}{first} (or {', '.join(others)})",
        )


def write_csv(columns: Columns) -> bytes:
    """Return named columns (N,) as the bytes of a CSV file; floats keep all their digits."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerow(re.sub(r"\s+", " ", name) for name in columns)
    cells = [map(repr, values.tolist()) for values in columns.values()]
    out.writelines(",".join(row) + "\n" for row in zip(*cells, strict=True))
    return out.getvalue().encode()


def _mat(recording: Recording, columns: Columns) -> bytes:
    from scipy.io import savemat

    out = io.BytesIO()
    variables: dict[str, object] = {
        re.sub(r"^(?=[^A-Za-z])", "c", re.sub(r"\W", "_", name, flags=re.ASCII)): v.astype(float)
        for name, v in columns.items()
    }
    variables["profile_json"] = to_json(recording.profile.to_dict())
    variables["meta_json"] = to_json(dict(recording.meta))
    savemat(out, variables, oned_as="column", do_compression=True)  # type: ignore[arg-type]
    return out.getvalue()


def _parquet(recording: Recording, columns: Columns) -> bytes:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise UsageError(
            "Parquet needs pyarrow, which is not installed.",
            cause="it is an optional dependency, because of its size.",
            fix="pip install 'heli3dof[parquet]', or export to .csv or .mat",
        ) from None
    about = {
        "heli3dof.profile": to_json(recording.profile.to_dict()),
        "heli3dof.meta": to_json(dict(recording.meta)),
    }
    table = pyarrow.table(columns).replace_schema_metadata(about)
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    data: bytes = sink.getvalue().to_pybytes()
    return data


FORMATS: dict[str, Callable[[Recording, Columns], bytes]] = {
    ".csv": lambda recording, columns: write_csv(columns),
    ".csv.gz": lambda recording, columns: gzip.compress(write_csv(columns), mtime=0),
    ".mat": _mat,
    ".parquet": _parquet,
    ".mcap": lambda recording, columns: foxglove_bytes(recording),
    ".rrd": rrd_bytes,
    ".xml": lambda recording, columns: layout("plotjuggler_layout.xml"),
}
"""Ending → function that returns the file's bytes"""
ENDINGS = {
    "csv": ".csv",
    "mat": ".mat",
    "parquet": ".parquet",
    "foxglove": "-3d.mcap",
    "rerun": ".rrd",
    "plotjuggler": ".xml",
}
"""Name of a format or viewer → ending that its file's name has by default"""


def layout(name: str) -> bytes:
    """Return a viewer's layout: the bytes of the file ``name`` in `heli3dof.recording.viewers`."""
    return (resources.files("heli3dof.recording.viewers") / name).read_bytes()
