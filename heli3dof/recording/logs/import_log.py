"""`import_log`: another program's log, CSV or MAT, into a `Recording` with the rig's profile."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from heli3dof.errors import RecordingError, UsageError
from heli3dof.recording.atomic_write import LOGS, stem
from heli3dof.recording.logs.column_table import recording_from_table
from heli3dof.recording.mcap_files.mcap_scan import missing, read_bytes, what_is
from heli3dof.recording.mcap_files.mcap_writer import MAGIC
from heli3dof.recording.provenance import provenance
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile


def is_log(path: str | Path) -> bool:
    """Whether a file's name says that it is a log to import."""
    return str(path).lower().endswith(LOGS)


def import_log(
    path: str | Path, profile: Profile, columns: str | Sequence[str] | None = None, *,
    believed: bool = True,
) -> Recording:  # fmt: skip
    """Read a CSV, gzipped CSV or MAT log as the contract describes it.

    A profile without ``[controller]`` says that the loop is unknown. ``columns`` names the rows
    or columns of a MAT matrix (see `heli3dof.recording.logs.mat_log.read_mat`). What is odd but
    usable is listed in ``meta["warnings"]``. Raises RecordingError, UsageError. Without
    ``believed`` no value is held against its column's name.
    """
    path = Path(path)
    if not path.exists():
        raise missing(path)
    lower = path.name.lower()
    if not is_log(path):
        if read_bytes(path).startswith(MAGIC[:5]):
            raise RecordingError(
                f"{path} is a recording already: there is nothing to import.",
                cause="it was imported before, or heli3dof recorded it itself.",
                fix=f"heli3dof info {path}; with --profile the other verbs take another profile",
            )
        raise RecordingError(
            f"{path} is not a log that can be imported; it is {what_is(read_bytes(path))}.",
            cause=f"its name does not end in {', '.join(LOGS)}.",
            fix="rename it by what it is, or export the log as CSV",
        )
    if lower.endswith(".mat"):
        from heli3dof.recording.logs.mat_log import read_mat

        table = read_mat(path, columns)
    else:
        if columns is not None:
            raise UsageError(
                f"--columns is for MAT matrices; {path.name} names its columns itself.",
                cause="the option was left over from another log.",
                fix="leave --columns out, or rename the columns in the header line",
            )
        from heli3dof.recording.logs.csv_log import read_csv

        table = read_csv(path)
    data = path.read_bytes()
    meta = provenance(
        source="import",
        name=stem(path),
        log={"file": path.name, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()},
    )
    del meta["started_utc"]  # when it was imported is not when it was flown
    return recording_from_table(table, profile, meta, believed=believed)
