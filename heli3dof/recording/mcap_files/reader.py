"""`read_recording`: an MCAP file into a `Recording`, in bulk.

Our own chunks are whole packed rows: they are checked and taken as arrays, 60 s at 500 Hz in
some tens of milliseconds. The same messages in another order (rewritten by other tools) are
gathered one by one; files of other programs go through `heli3dof.recording.logs.mcap_import`.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from mcap.opcode import Opcode

from heli3dof.errors import ProfileError, RecordingError
from heli3dof.recording.mcap_files.mcap_scan import (
    Damaged,
    Scan,
    decode_chunk,
    read_bytes,
    records_in,
    scan,
    what_is,
)
from heli3dof.recording.mcap_files.mcap_writer import MAGIC, OUTCOME, PROFILE, PROVENANCE
from heli3dof.recording.mcap_files.schema import (
    CHANNELS_TOPIC,
    COMMAND,
    SAMPLE,
    Layout,
    RowFormat,
    channels_layout,
)
from heli3dof.recording.recording import Recording
from heli3dof.recording.write import ARRAYS, COLUMNS, CORE
from heli3dof.rig.link_counters import present_names
from heli3dof.rig.profile import Profile, profile_from_dict


def read_recording(path: str | Path, profile: Profile | None = None) -> Recording:
    """Read an MCAP recording: ours, or another program's with the contract's columns.

    ``profile`` replaces the one in the file; a file of another program needs it. Raises
    RecordingError for a file that is missing, torn, no MCAP, or MCAP of something else.
    """
    path = Path(path)
    found = open_mcap(path)
    if not found.whole:
        raise torn(path, found)
    try:
        if not found.intact:
            raise Damaged("the checksum over its data is wrong")
        layouts = our_layouts(found)
        if layouts is None:
            from heli3dof.recording.logs.mcap_import import read_foreign

            foreign: Recording = read_foreign(path, found, profile)
            return foreign
        form = RowFormat(layouts)
        rows = _bulk_rows(found, form)
        if rows is None:
            rows = _gathered_rows(path, found, form)
    except Damaged as error:
        raise RecordingError(
            f"{path} is damaged: {error}.",
            cause="the disk or a copy over the network changed some bytes.",
            fix=f"copy it again, or heli3dof recover {path} for what is left",
        ) from error
    if not len(rows):
        ended = found.metadata.get(OUTCOME, {})
        how = ", ".join(str(ended[key]) for key in ("outcome", "detail") if key in ended)
        raise RecordingError(
            f"{path} holds no samples" + (f": {how}." if how else "."),
            cause="the flight ended before its first control period.",
            fix="fly again",
        )
    return decode(rows, found, profile or profile_in(found, path), path)


def open_mcap(path: Path) -> Scan:
    """Scan an MCAP file, torn or not. Raises RecordingError where it is none."""
    data = read_bytes(path)
    if not data.startswith(MAGIC):
        kind = what_is(data)
        ending = ".csv" if "CSV" in kind else ".mat" if "MAT" in kind else ""
        named = path.with_suffix(ending) if ending else path
        raise RecordingError(
            f"{path} is not an MCAP recording; it is {kind}.",
            cause="a log that was not imported yet."
            if ending
            else "another file was meant, or the name's ending is wrong.",
            fix=(f"mv {path} {named}; " if named != path else "")
            + f"heli3dof import {named} --profile PROFILE.toml -o {path.stem}.mcap"
            if ending
            else f"ls {path.parent}",
        )
    return scan(data)


def torn(path: Path, found: Scan) -> RecordingError:
    """The error for a file without its end."""
    return RecordingError(
        f"{path} is torn: it ends after {found.good} bytes without its closing records.",
        cause="the program was killed, the disk was full or the copy was cut short; "
        "or it is still being recorded.",
        fix=f"heli3dof recover {path}",
    )


def our_layouts(found: Scan) -> list[Layout] | None:
    """The layouts of a file of ours; None for another program's file."""
    by_topic = {c.topic: c for c in found.channels.values()}
    layouts = [SAMPLE, COMMAND]
    if CHANNELS_TOPIC in by_topic:
        names = found_names(found)
        layouts.append(channels_layout(names))
    for layout in layouts:
        channel = by_topic.get(layout.topic)
        schema = None if channel is None else found.schemas.get(channel.schema_id)
        if schema is None or schema.data != layout.descriptor_set:
            return None
    return layouts


def found_names(found: Scan) -> list[str]:
    """The names of the further channels, from the MCAP channel's metadata."""
    for channel in found.channels.values():
        if channel.topic == CHANNELS_TOPIC:
            try:
                names: list[str] = json.loads(channel.metadata["columns"])
                return names
            except (KeyError, json.JSONDecodeError) as error:
                raise Damaged("the names of its further channels are lost") from error
    return []


def chunk_rows(data: bytes, form: RowFormat) -> np.ndarray | None:
    """The rows of one uncompressed chunk, or None where it is laid out otherwise."""
    if len(data) and data[0] != Opcode.MESSAGE:  # schemas and channels may stand in front
        front = next((a - 9 for kind, a, _ in records_in(data)[0] if kind == Opcode.MESSAGE), None)
        data = data[len(data) if front is None else front :]
    return form.parse(data)


def _bulk_rows(found: Scan, form: RowFormat) -> np.ndarray | None:
    topics = [c.topic for _, c in sorted(found.channels.items())]
    if sorted(found.channels) != list(range(1, len(form.layouts) + 1)) or topics != [
        layout.topic for layout in form.layouts
    ]:
        return None
    parts: list[np.ndarray] = []
    for kind, start, end in found.records:
        if kind == Opcode.MESSAGE:
            return None
        if kind == Opcode.CHUNK:
            rows = chunk_rows(decode_chunk(found.data[start:end]), form)
            if rows is None:
                return None
            parts.append(rows.view(np.uint8))  # joining structured arrays costs five times more
    return np.concatenate(parts).view(form.dtype) if parts else form.empty(0)


def _gathered_rows(path: Path, found: Scan, form: RowFormat) -> np.ndarray:
    """The same messages in any order, paired by their log times."""
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
            f"{path}: samples and commands do not belong together ({counts}).",
            cause="another tool dropped messages of one topic when it rewrote the file.",
            fix="use the original recording",
        )
    rows = form.empty(len(times[0]))
    for layout, column in zip(form.layouts, columns, strict=True):
        part = rows[layout.name]
        part["log_time"] = part["publish_time"] = times[0]
        if any(len(m[1]) != layout.payload.itemsize for m in column):
            raise Damaged(f"a message on {layout.topic} has a wrong length")
        values = np.frombuffer(b"".join(m[1] for m in column), layout.payload)
        for name in layout.payload.names or ():
            if name.startswith("tag") and not (values[name] == part[name]).all():
                raise Damaged(f"a message on {layout.topic} has another layout")
            part[name] = values[name]
    return rows


def decode(rows: np.ndarray, found: Scan, profile: Profile, path: Path) -> Recording:
    """A `Recording` from the rows of a file of ours."""
    absent = set(found.metadata.get(COLUMNS, {}).get("absent", ()))
    stored = COLUMNS in found.metadata
    column = {
        c.name: np.ascontiguousarray(rows[layout.name][c.name])
        for layout in (SAMPLE, COMMAND)
        for c in layout.columns
        if c.name not in absent
    }
    arrays: dict[str, np.ndarray] = {
        array: np.column_stack([column[name] for name in names])
        for array, names in ARRAYS.items()
        if array != "t"
    }
    if np.isnan(arrays["voltage"]).all() and "v_front_sent_V" in column:
        # The device does not report what it puts out: then what it was sent is what is known.
        arrays["voltage"] = np.column_stack([column["v_front_sent_V"], column["v_back_sent_V"]])
    channels: dict[str, np.ndarray] = {}
    for name, values in column.items():
        if name in CORE:
            continue
        if values.dtype.kind != "f":
            channels[name] = values.astype(np.int64)
        elif stored or not np.isnan(values).all():
            channels[name] = values
    for number, name in enumerate(found_names(found), 1):
        channels[name] = np.ascontiguousarray(rows["Channels"][f"column{number}"])
    return Recording(
        t=column["t_s"], profile=profile, channels=channels, meta=meta_in(found, path), **arrays
    )


def meta_in(found: Scan, path: Path) -> dict[str, Any]:
    """``Recording.meta`` from the file's metadata records."""
    meta: dict[str, Any] = {"name": path.stem, **found.metadata.get(PROVENANCE, {})}
    details = dict(found.metadata.get(OUTCOME, {}))
    details.pop("rows", None)
    if "outcome" in details:
        meta["outcome"] = details.pop("outcome")
    if details:
        meta["outcome_details"] = present_names(details)
    return meta


def profile_in(found: Scan, path: Path) -> Profile:
    """The profile that a file carries. Raises RecordingError where it has none that is usable."""
    record = found.metadata.get(PROFILE, {}).get("profile")
    try:
        if record is None:
            raise ProfileError("the file carries no profile")
        return profile_from_dict(record, source=f"the profile in {path}", recorded=True)
    except ProfileError as error:
        raise RecordingError(
            f"{path}: {error.what}",
            cause=error.cause or "another program wrote it, or an older heli3dof.",
            fix="name the rig's profile with --profile PROFILE.toml",
        ) from error
