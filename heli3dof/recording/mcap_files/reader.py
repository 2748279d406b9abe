"""`read_recording`: reads an MCAP file as a `Recording`.

heli3dof writes chunks of packed rows, which are read as arrays (tens of milliseconds for 60 s at
500 Hz). If a tool has changed this layout, the messages are read one by one. Recordings of other
programs are imported (`heli3dof.recording.logs.import_log`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from heli3dof.errors import ProfileError, RecordingError, quoted
from heli3dof.file_kind import other_file
from heli3dof.recording.columns import ARRAYS
from heli3dof.recording.logs.import_log import import_log
from heli3dof.recording.logs.importers import endings
from heli3dof.recording.mcap_files.mcap_scan import (
    Damaged,
    Scan,
    channel_names,
    damaged,
    decode_chunk,
    our_format,
    read_bytes,
    records_in,
    scan,
    what_is,
)
from heli3dof.recording.mcap_files.mcap_writer import MAGIC, OUTCOME, PROFILE, PROVENANCE
from heli3dof.recording.mcap_files.schema import COMMAND, SAMPLE, RowFormat
from heli3dof.recording.recording import Recording, output_voltage
from heli3dof.recording.write import COLUMNS, CORE
from heli3dof.rig.link_counters import present_names
from heli3dof.rig.profile import Profile, profile_from_dict


def read_recording(path: str | Path, profile: Profile | None = None) -> Recording:
    """Return the recording in an MCAP file, which heli3dof or another program has written.

    ``profile`` replaces the profile in the file. A file of another program needs this argument
    unless the file contains a profile. Raises RecordingError for a file that is missing, torn (its
    end is missing), damaged or not an MCAP file. It is also raised if the file contains no samples,
    or not the required columns (docs/reference/recording.md).
    """
    path = Path(path)
    found = open_mcap(path)
    unreadable = broken(path, found)
    if unreadable is not None:
        raise unreadable
    try:
        form = our_format(found)
        if form is None:
            return import_log(path, profile)
        rows, other_chunks = intact_rows(found, form)
        if other_chunks or any(kind == Opcode.MESSAGE for kind, _, _ in found.records):
            rows = _gathered_rows(path, found, form)
    except Damaged as error:
        raise damaged(path, error) from error
    if not len(rows):
        ended = found.metadata.get(OUTCOME, {})
        reason = ", ".join(str(ended[key]) for key in ("outcome", "detail") if key in ended)
        raise RecordingError(
            f"{path} contains no samples" + (f": {reason}." if reason else "."),
            cause="the flight ended before its first control period.",
            fix="repeat the experiment",
        )
    return recording_of(rows, found, profile or profile_in(found, path), path)


def open_mcap(path: Path) -> Scan:
    """Return the records of an MCAP file, even if its end is missing or a part is unreadable.

    Raises RecordingError for a file that is not an MCAP file.
    """
    data = read_bytes(path)
    if not data.startswith(MAGIC):
        kind = what_is(data)
        ending = ".csv" if "CSV" in kind else ".mat" if "MAT" in kind else ""
        named = path.with_suffix(ending) if ending else path
        if (other := other_file(path)) is not None:
            kind, fix = other
            cause = "another kind of file was given in place of a recording."
        elif ending:
            cause = "a log that was not imported yet."
            fix = f"mv {quoted(path)} {quoted(named)}; " if named != path else ""
            fix += f"heli3dof import {quoted(named)} --profile PROFILE.toml "
            fix += f"-o {quoted(path.stem)}.mcap"
        else:
            cause = "a log in a format that cannot be read, or another file than you meant."
            fix = f"write the log in one of these formats: {', '.join(sorted(endings()))}"
        raise RecordingError(
            f"{path} is not an MCAP recording; it is {kind}.", cause=cause, fix=fix
        )
    return scan(data)


def broken(path: Path, found: Scan) -> RecordingError | None:
    """Return the error for an MCAP file with missing or wrong bytes; None for any other."""
    if found.gaps:
        lost = f"{found.bytes_lost} bytes are unreadable, the first at {found.gaps[0][0]}"
        return damaged(path, Damaged(lost), " in the middle")
    if found.whole and not found.intact:
        return damaged(path, Damaged("the checksum of its data is wrong"))
    if found.whole:
        return None
    return RecordingError(
        f"{path} is torn: it ends after {found.good} bytes without its closing records.",
        cause="the program was killed, the disk was full, the copy is incomplete, or it is still "
        "being recorded.",
        fix=f"heli3dof recover {quoted(path)}",
    )


def intact_rows(found: Scan, form: RowFormat) -> tuple[np.ndarray, int]:
    """Return the rows (n,) of all chunks of packed rows, and the number of other chunks.

    The other chunks are damaged, or have other records than rows in the format ``form``.
    """
    parts: list[np.ndarray] = []
    others = 0
    for content in found.of(Opcode.CHUNK):
        try:
            rows = _chunk_rows(decode_chunk(content), form)
        except Damaged:
            rows = None
        if rows is None:
            others += 1
        else:
            parts.append(rows.view(np.uint8))  # joining structured arrays is five times slower
    return np.concatenate(parts).view(form.dtype) if parts else form.empty(0), others


def _chunk_rows(data: bytes, form: RowFormat) -> np.ndarray | None:
    """Return the rows (n,) in ``data``, an uncompressed chunk; None if it has other records."""
    if len(data) and data[0] != Opcode.MESSAGE:  # schemas and channels may come first
        front = next((a - 9 for kind, a, _ in records_in(data)[0] if kind == Opcode.MESSAGE), None)
        data = data[len(data) if front is None else front :]
    return form.parse(data)


def _gathered_rows(path: Path, found: Scan, form: RowFormat) -> np.ndarray:
    """Return rows read message by message; messages with the same log time form a row.

    Raises RecordingError if the topics' log times differ, and Damaged for an invalid message.
    """
    ids = {c.topic: i for i, c in found.channels.items()}
    payloads: dict[int, list[tuple[int, bytes]]] = {i: [] for i in ids.values()}
    for channel, log_time, payload in found.messages():
        payloads.setdefault(channel, []).append((log_time, payload))
    columns = [sorted(payloads[ids[layout.topic]], key=lambda m: m[0]) for layout in form.layouts]
    times = [[m[0] for m in column] for column in columns]
    if any(other != times[0] for other in times[1:]):
        counts = ", ".join(
            f"{len(c)} on {x.topic}" for c, x in zip(columns, form.layouts, strict=True)
        )
        raise RecordingError(
            f"{path}: samples and commands do not match ({counts}).",
            cause="another tool dropped messages of one topic when it rewrote the file.",
            fix="use the original recording",
        )
    rows = form.empty(len(times[0]))
    for layout, column in zip(form.layouts, columns, strict=True):
        part = rows[layout.name]
        part["log_time"] = part["publish_time"] = times[0]
        if any(len(m[1]) != layout.payload.itemsize for m in column):
            raise Damaged(f"a message on {layout.topic} has the wrong length")
        values = np.frombuffer(b"".join(m[1] for m in column), layout.payload)
        for name in layout.payload.names or ():
            if name.startswith("tag") and not (values[name] == part[name]).all():
                raise Damaged(f"a message on {layout.topic} has another layout")
            part[name] = values[name]
    return rows


def recording_of(rows: np.ndarray, found: Scan, profile: Profile, path: Path) -> Recording:
    """Return a `Recording` made of the rows (N,) of a file that heli3dof wrote."""
    absent = found.metadata[COLUMNS].get("absent", ()) if COLUMNS in found.metadata else None
    meta: dict[str, Any] = {"name": path.stem, **found.metadata.get(PROVENANCE, {})}
    details = dict(found.metadata.get(OUTCOME, {}))
    details.pop("rows", None)
    if "outcome" in details:
        meta["outcome"] = details.pop("outcome")
    if details:
        meta["outcome_details"] = present_names(details)
    return decode(rows, profile, meta, absent, channel_names(found))


def decode(
    rows: np.ndarray,
    profile: Profile,
    meta: Mapping[str, Any],
    absent: Collection[str] | None = None,
    names: Sequence[str] = (),
) -> Recording:
    """Return a `Recording` made of the rows (N,) in the format `RowFormat`.

    ``absent``: message fields that the recording lacks. None if the file does not list them: then
    channels whose values are all NaN are left out. ``names``: names of the further columns, which
    are in the message Channels.
    """
    column = {
        c.name: np.array(rows[layout.name][c.name])
        for layout in (SAMPLE, COMMAND)
        for c in layout.columns
        if c.name not in (absent or ())
    }
    arrays: dict[str, Any] = {
        array: np.column_stack([column[name] for name in names]) for array, names in ARRAYS.items()
    }
    if "v_front_sent_V" in column:
        sent = np.column_stack([column["v_front_sent_V"], column["v_back_sent_V"]])
        arrays["voltage"] = output_voltage(arrays["voltage"], sent)
    channels: dict[str, np.ndarray] = {}
    for name, values in column.items():
        if name in CORE:
            continue
        if values.dtype.kind != "f":
            channels[name] = values.astype(np.int64)
        elif absent is not None or not np.isnan(values).all():
            channels[name] = values
    for number, name in enumerate(names, 1):
        channels[name] = np.array(rows["Channels"][f"column{number}"])
    return Recording(t=column["t_s"], profile=profile, channels=channels, meta=dict(meta), **arrays)


def profile_in(found: Scan, path: Path) -> Profile:
    """Return the rig's profile from a file's records ``found``.

    Raises RecordingError if the file contains no profile or an invalid one.
    """
    record = found.metadata.get(PROFILE, {}).get("profile")
    try:
        if record is None:
            raise ProfileError("the file contains no profile")
        return profile_from_dict(record, source=f"the profile in {path}", recorded=True)
    except ProfileError as error:
        raise RecordingError(
            f"{path}: {error.what}",
            cause=error.cause or "another program or an older heli3dof wrote it.",
            fix="add the rig's profile: profile='PROFILE.toml'",
        ) from error
