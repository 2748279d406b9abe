"""`import_log`: reads another program's log, in any format that has an importer."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import Heli3dofError, RecordingError, UsageError, quoted
from heli3dof.file_kind import no_file
from heli3dof.plugins import must_be, plugin_errors
from heli3dof.recording.atomic_write import stem
from heli3dof.recording.logs.column_mapping import mapped
from heli3dof.recording.logs.column_table import recording_from_table
from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.logs.importers import endings, importer_of
from heli3dof.recording.logs.joined_tables import join, join_used
from heli3dof.recording.logs.known_names import with_own_names
from heli3dof.recording.logs.lower_rate import at_rate, with_mean_voltages
from heli3dof.recording.mcap_files.mcap_scan import read_bytes, refuse_stream, what_is
from heli3dof.recording.mcap_files.mcap_writer import MAGIC
from heli3dof.recording.provenance import provenance
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile


def is_log(path: str | Path) -> bool:
    """Return True if ``path`` is a log whose format contains no rig's profile, such as CSV or MAT.

    The file need not exist: usually the ending of its name decides.
    """
    importer = importer_of(path)
    return importer is not None and not importer.carries_profile


def import_log(
    paths: str | Path | Sequence[str | Path],
    profile: Profile | None,
    columns: str | Sequence[str] | None = None,
    *,
    mapping: Mapping[str, str] | None = None,
    rate_hz: float | None = None,
    check_values: bool = True,
) -> Recording:
    """Read another program's log (CSV, gzipped CSV, MAT, MCAP) as a `Recording`.

    * ``paths``: the log's file, or several files of one flight with a common clock
    * ``profile``: the rig's profile. None selects the profile in the file, for MCAP files only. If
      the profile has no ``[controller]``, the flight's controller is unknown.
    * ``columns``: names of the rows or columns of a matrix in a MAT file
    * ``mapping``: column → expression of the log's columns (`column_mapping`); it adds to the
      profile's ``[log]``
    * ``rate_hz``: keep the rows at this rate (`lower_rate`), which becomes the profile's
      ``loop.rate_hz``
    * ``check_values=False`` skips the tests whether the angles and voltages have plausible values
      for the units in the columns' names

    Warnings are in ``Recording.meta["warnings"]``. Raises RecordingError or UsageError.
    """
    table = read_log(paths, profile, columns, mapping, rate_hz)
    return recording_of(paths, table, check_values=check_values)


def read_log(
    paths: str | Path | Sequence[str | Path],
    profile: Profile | None,
    columns: str | Sequence[str] | None = None,
    mapping: Mapping[str, str] | None = None,
    rate_hz: float | None = None,
) -> Table:
    """Return the log of one flight as one table, before its values are checked.

    The table contains the columns of all files and the columns that the mapping computes. Its
    attribute ``profile`` is the rig's profile. `import_log` describes the arguments. Raises
    RecordingError or UsageError.
    """
    files = _files(paths)
    if len(files) > 1 and columns is not None:
        raise UsageError(
            "columns names the columns of one file, but several were given.",
            cause="the files are parts of one flight.",
            fix="--map, with the names that heli3dof import shows without --columns",
        )
    defaults = profile.log.expressions if profile is not None and profile.log is not None else {}
    expressions = [*(mapping or {}).values(), *defaults.values()]
    table = join([_table(path, profile, columns, expressions) for path in files])
    profile = profile or table.profile
    assert profile is not None  # else the importer has raised an error
    defaults = profile.log.expressions if profile.log is not None else {}
    table = with_mean_voltages(with_own_names(mapped(table, mapping or {}, defaults)))
    if rate_hz is not None and "t_s" in table.columns:
        table = at_rate(table, profile, rate_hz)
        kept_hz = round(1 / float(np.median(np.diff(table.columns["t_s"]))), 6)
        loop = profile.loop.model_copy(update={"rate_hz": kept_hz})
        profile = profile.model_copy(update={"loop": loop})
    return replace(table, profile=profile)


def recording_of(
    paths: str | Path | Sequence[str | Path], table: Table, *, check_values: bool = True
) -> Recording:
    """Check the table that `read_log` read from ``paths``, and return it as a `Recording`.

    ``check_values=False`` skips the tests whether the angles and voltages have plausible values for
    the units in the columns' names.
    """
    files = _files(paths)
    first, *others = (_digest(path) for path in files)
    # The advice how to correct an angle is an expression of this column, in its unit.
    in_rad = {name: name for name in (f"{axis}_rad" for axis in AXES) if name in table.columns}
    meta = provenance(
        source="import",
        name="+".join(stem(path) for path in files),
        log=first,
        more_logs=others or None,
        log_mapping={**in_rad, **table.origins} or None,
    )
    del meta["started_utc"]  # the time of the import is not the time of the flight
    assert table.profile is not None
    return recording_from_table(table, table.profile, meta, check_values=check_values)


def _files(paths: str | Path | Sequence[str | Path]) -> list[Path]:
    return [Path(p) for p in ([paths] if isinstance(paths, str | Path) else paths)]


def _digest(path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    return {"file": path.name, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def _table(
    path: Path,
    profile: Profile | None,
    columns: str | Sequence[str] | None,
    expressions: Sequence[str],
) -> Table:
    """Return the table of one file. `_read` and `import_log` describe the arguments."""
    if not path.exists():
        raise no_file(path, "recording", RecordingError)
    refuse_stream(path)
    importer = importer_of(path)
    if importer is None:
        raise _not_importable(path)
    if profile is None and not importer.carries_profile:
        raise UsageError(
            f"{path} is a log, which does not contain the rig's profile.",
            cause="no profile was named.",
            fix=f"add profile='PROFILE.toml', or import it once: heli3dof import {quoted(path)} "
            f"--profile PROFILE.toml -o {quoted(stem(path))}.mcap",
        )
    return _read(importer, path, profile, columns, expressions)


def _read(
    importer: Importer,
    path: Path,
    profile: Profile | None,
    columns: str | Sequence[str] | None,
    expressions: Sequence[str],
) -> Table:
    """Return the file's table; convert an importer's unexpected exceptions to RecordingError.

    An importer therefore need not catch the exceptions of its parser. The function does not convert
    OSError and the errors of heli3dof. ``expressions``: the formulas of the recording's columns,
    which the ``--map`` options and the profile's ``[log]`` state. If the file has several tables,
    the function may leave out those that no expression needs (`join_used`).
    """
    try:
        if importer.read_tables is not None and columns is None:
            table = join_used(importer.read_tables(path), expressions)
        else:
            table = importer.read(path, profile, columns)
        must_be(Table, table)
        where = partial(_where, importer, table.where)
        return replace(table, columns=_numeric(table.columns), where=where)
    except (Heli3dofError, OSError):
        raise
    except (Exception, SystemExit) as error:  # KeyError, struct.error …
        raise RecordingError(
            f"{path} cannot be read by the importer {importer.name}: "
            f"{type(error).__name__}: {error}",
            cause="the file is damaged or not of this format, or the importer has a bug.",
            fix="write the log again with the program that made it, or export it as CSV and "
            "heli3dof import that file",
        ) from error


def _where(importer: Importer, where: Callable[[int], str], k: int) -> str:
    """Return ``where(k)``, the position of sample k, by a function of the importer."""
    module = importer.read.__module__
    with plugin_errors(RecordingError, f"Table.where of the importer {importer.name}", module):
        return where(k)


def _numeric(columns: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return an importer's columns as arrays (N,) of floats.

    Raises ValueError if there is no column, if a column is not a vector of numbers, or if the
    columns differ in length.
    """
    if not columns:
        raise ValueError("its table has no column")
    arrays: dict[str, np.ndarray] = {}
    for name, column in columns.items():
        try:
            arrays[name] = np.asarray(column, dtype=float)
        except (TypeError, ValueError) as error:
            raise ValueError(f"its column {name} contains no numbers: {error}") from error
    shapes = {name: array.shape for name, array in arrays.items()}
    if len(set(shapes.values())) > 1:
        raise ValueError(f"its columns have different shapes: {shapes}")
    if len(next(iter(shapes.values()))) != 1:
        raise ValueError(f"its columns are not vectors: {shapes}")
    return arrays


def _not_importable(path: Path) -> RecordingError:
    data = read_bytes(path)
    if data.startswith(MAGIC[:5]):
        return RecordingError(
            f"{path} is a recording already: there is nothing to import.",
            cause="it was imported before, or heli3dof recorded it.",
            fix=f"heli3dof info {quoted(path)}; load takes another profile",
        )
    return RecordingError(
        f"{path} is not a log that can be imported; it is {what_is(data)}.",
        cause=f"{path.suffix or 'a name without ending'} is not among the formats that can be "
        f"read: {', '.join(sorted(endings()))}.",
        fix="write the log as CSV with a header line; if it has one of these formats, correct the "
        "ending of its name",
    )
