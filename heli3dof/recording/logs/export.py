"""`export`: a `Recording` for other programs, with the contract's columns.

CSV (``.csv``, ``.csv.gz``), MAT (``.mat``, a vector per column) and Parquet (``.parquet``, the
extra of that name). Angles in degrees, every digit kept: importing it again gives the arrays
back to 1e-12. Profile and provenance go along where the format can hold them.
"""

from __future__ import annotations

import gzip
import io
import re
from pathlib import Path

import numpy as np

from heli3dof.axes import AXES, MOTORS
from heli3dof.errors import UsageError, did_you_mean
from heli3dof.recording.atomic_write import check_output, write_file
from heli3dof.recording.logs.column_table import ANGLES, VOLTAGES
from heli3dof.recording.logs.csv_log import write_csv
from heli3dof.recording.mcap_files.mcap_writer import to_json
from heli3dof.recording.recording import Recording

FORMATS = (".csv", ".csv.gz", ".mat", ".parquet")


def export(recording: Recording, path: str | Path, *, force: bool = False) -> Path:
    """Write a recording in the format that the file's ending names.

    Raises OutputExists (without ``force``), UsageError (unknown ending, pyarrow missing), NoSpace.
    """
    path = Path(path)
    check_format(path)
    check_output(path, force=force)
    columns = contract_columns(recording)
    name = path.name.lower()
    if name.endswith(".csv"):
        data = write_csv(columns)
    elif name.endswith(".csv.gz"):
        data = gzip.compress(write_csv(columns), mtime=0)
    elif name.endswith(".mat"):
        data = _mat(recording, columns)
    else:
        data = _parquet(recording, columns)
    return write_file(path, data, force=force)


def check_format(path: Path) -> None:
    """Raise UsageError for a file name that says no format of `FORMATS`."""
    if not path.name.lower().endswith(FORMATS):
        ending = path.suffix or path.name
        raise UsageError(
            f"No format is known by the ending {ending!r}.",
            cause=f"a typing error; {did_you_mean(ending, FORMATS)}",
            fix=f"-o {path.stem}.csv (or {', '.join(FORMATS[1:])})",
        )


def contract_columns(recording: Recording) -> dict[str, np.ndarray]:
    """The contract's columns that the recording has, angles in degrees, then its channels."""
    columns: dict[str, np.ndarray] = {"t_s": recording.t}
    for array, form in VOLTAGES.items():
        for i, motor in enumerate(MOTORS):
            columns[form.format(motor)] = getattr(recording, array)[:, i]
    for array, form in ANGLES.items():
        for i, axis in enumerate(AXES):
            columns[f"{form.format(axis)}_deg"] = np.rad2deg(getattr(recording, array)[:, i])
    columns = {name: v for name, v in columns.items() if not np.isnan(v).all()}
    for name, values in recording.channels.items():
        columns[name if name not in columns else f"channel_{name}"] = values
    return columns


def _mat(recording: Recording, columns: dict[str, np.ndarray]) -> bytes:
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


def _parquet(recording: Recording, columns: dict[str, np.ndarray]) -> bytes:
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise UsageError(
            "Parquet needs pyarrow, which is not installed.",
            cause="it is an extra, because of its size.",
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
