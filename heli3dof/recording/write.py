"""`write_recording`: writes a `Recording` to an MCAP file, completely or not at all.

Message fields that the recording lacks are NaN (integers: 0) in the file. The metadata record
``heli3dof.columns`` lists these fields, so that reading the file restores the recording.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.errors import UsageError
from heli3dof.recording.atomic_write import check_ending, new_file
from heli3dof.recording.columns import ARRAYS
from heli3dof.recording.mcap_files.flight_recorder import profile_record
from heli3dof.recording.mcap_files.mcap_writer import OUTCOME, PROFILE, PROVENANCE, write_rows
from heli3dof.recording.mcap_files.schema import (
    COMMAND,
    FORMAT,
    KINDS,
    MAX_CHANNELS,
    SAMPLE,
    RowFormat,
)
from heli3dof.recording.recording import Recording

COLUMNS = "heli3dof.columns"
CORE = {"t_s", *(name for names in ARRAYS.values() for name in names)}
"""Fields of the messages that hold the columns of a `Recording`'s arrays"""


def write_recording(recording: Recording, path: str | Path, *, force: bool = False) -> Path:
    """Write a recording to the MCAP file ``path`` and return the path.

    `read_recording` restores equal arrays, channels and meta, which is stored as JSON: tuples in it
    become lists. Raises OutputExists if the file
    exists, unless ``force``; NoSpace or UsageError if the file cannot be written. The ending of
    another format, such as .csv, also raises UsageError.
    """
    path = Path(path)
    check_ending(path, ".mcap")
    form, rows, absent = encode(recording)
    with new_file(path, force=force) as stream:
        write_rows(stream, form, rows, metadata(recording, absent))
    return path


def metadata(recording: Recording, absent: list[str]) -> dict[str, dict[str, Any]]:
    """Return the metadata records of a recording's file: name → content, in the file's order.

    ``absent``: names of the message fields that the recording lacks.
    """
    meta = {k: v for k, v in recording.meta.items() if k not in {"outcome", "outcome_details"}}
    outcome: dict[str, Any] = {"rows": len(recording)}
    if "outcome" in recording.meta:
        outcome["outcome"] = recording.meta["outcome"]
    outcome |= dict(recording.meta.get("outcome_details", {}))
    return {
        PROFILE: profile_record(recording.profile),
        PROVENANCE: {"format": FORMAT, **meta},
        COLUMNS: {"absent": absent},
        OUTCOME: outcome,
    }


def encode(recording: Recording) -> tuple[RowFormat, np.ndarray, list[str]]:
    """Return (format, rows, absent): a recording as the rows of an MCAP file.

    * ``format``: byte format of the rows
    * ``rows``: the recording's samples, as a structured array in this format
    * ``absent``: names of the fields of the messages Sample and Command that the recording lacks

    The message Channels contains the recording's channels that have no field in Sample or Command.
    Raises UsageError if these are more than `MAX_CHANNELS`.
    """
    channels = {name: np.asarray(column) for name, column in recording.channels.items()}
    known: dict[str, np.ndarray] = {"t_s": recording.t}
    absent: list[str] = []
    for array, columns in ARRAYS.items():
        known |= zip(columns, getattr(recording, array).T, strict=True)
    for layout in (SAMPLE, COMMAND):
        for column in layout.columns:
            if column.name in CORE:
                continue
            if column.name in channels and _fits(channels[column.name], column.kind):
                known[column.name] = channels.pop(column.name)
            else:
                absent.append(column.name)
    extra = list(channels)
    if len(extra) > MAX_CHANNELS:
        raise UsageError(
            f"The recording has {len(extra)} further channels; a file holds {MAX_CHANNELS}.",
            cause="a transposed log, with a column per sample.",
            fix="keep only the necessary columns",
        )
    form = RowFormat(extra)
    rows = form.empty(len(recording))
    start = int(recording.meta.get("start_ns", 0))
    since = np.rint((recording.t - min(0.0, float(recording.t[0]))) * 1e9).astype("<u8")
    for layout in form.layouts:
        part = rows[layout.name]
        part["mcap_sequence"] = np.arange(len(rows)) & 0xFFFFFFFF
        part["log_time"] = part["publish_time"] = since + np.uint64(start)
    for layout in (SAMPLE, COMMAND):
        for column in layout.columns:
            missing = np.nan if column.kind == "double" else 0
            rows[layout.name][column.name] = known.get(column.name, missing)
    for number, name in enumerate(extra, 1):
        rows["Channels"][f"column{number}"] = channels[name]
    return form, rows, absent


def _fits(values: np.ndarray, kind: str) -> bool:
    if kind == "double":
        return True
    limits = np.iinfo(KINDS[kind][2])
    inside = (values >= limits.min) & (values <= limits.max)
    return bool((inside & (values == np.floor(values))).all())
