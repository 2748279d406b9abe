"""MCAP files of other programs, where they hold the contract's columns.

JSON messages and protobuf messages are decoded properly, message by message. Fields of one
message are the columns; other topics join in where they were logged at the same instants.
Nothing is resampled.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Schema

from heli3dof.errors import RecordingError
from heli3dof.recording.logs.column_table import KNOWN, Table, recording_from_table
from heli3dof.recording.mcap_files.mcap_scan import Scan
from heli3dof.recording.mcap_files.mcap_writer import PROFILE
from heli3dof.recording.provenance import provenance
from heli3dof.recording.recording import Recording
from heli3dof.rig.profile import Profile, profile_from_dict

Decoder = Callable[[bytes], Mapping[str, Any]]
VOLTAGES = {"v_front_V", "v_back_V"}


def read_foreign(path: Path, found: Scan, profile: Profile | None) -> Recording:
    """A `Recording` from another program's MCAP. Raises RecordingError naming its topics."""
    if profile is None and PROFILE in found.metadata:
        profile = profile_from_dict(
            found.metadata[PROFILE].get("profile") or {},
            source=f"the profile in {path}",
            recorded=True,
        )
    messages: dict[int, list[tuple[int, bytes]]] = {}
    for number, log_time, payload in found.messages():
        messages.setdefault(number, []).append((log_time, payload))
    tables: dict[int, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
    undecoded: list[str] = []
    for number, channel in found.channels.items():
        if number not in messages:
            continue
        decode = _decoder(channel, found.schemas.get(channel.schema_id), undecoded)
        if decode is not None:
            tables[number] = _columns(path, channel.topic, messages[number], decode)
    base = next((i for i, (_, c) in tables.items() if c.keys() >= VOLTAGES), None)
    if base is None:
        raise RecordingError(
            f"{path} is an MCAP file, but not a flight of a 3-DOF helicopter: no topic has "
            f"v_front_V and v_back_V. Its topics: {_topics(found)}."
            + (f" Not decoded: {'; '.join(undecoded)}." if undecoded else ""),
            cause="a recording of another system, or columns under other names.",
            fix="export it as CSV with the columns t_s,v_front_V,v_back_V,roll_deg,… and "
            "heli3dof import that",
        )
    if profile is None:
        raise RecordingError(
            f"{path} was written by another program and carries no profile of the rig.",
            cause="only heli3dof's own recordings carry one.",
            fix="name it with --profile PROFILE.toml",
        )
    table = _joined(path, found, tables, base)
    meta = provenance(
        source="import",
        name=path.stem,
        log={
            "file": path.name,
            "bytes": len(found.data),
            "sha256": hashlib.sha256(found.data).hexdigest(),
        },
    )
    del meta["started_utc"]
    return recording_from_table(table, profile, meta)


def _joined(
    path: Path,
    found: Scan,
    tables: Mapping[int, tuple[np.ndarray, dict[str, np.ndarray]]],
    base: int,
) -> Table:
    warnings: list[str] = []
    log_time, columns = tables[base]
    columns = dict(columns)
    if "t_s" not in columns:
        columns["t_s"] = (log_time - log_time[0]) / 1e9
        warnings.append("There is no t_s; the messages' log time was taken.")
    for number, (other_time, others) in tables.items():
        if number == base:
            continue
        topic = found.channels[number].topic
        new = {name: v for name, v in others.items() if name not in columns}
        if np.array_equal(other_time, log_time):
            columns |= new
        elif new.keys() & KNOWN:
            warnings.append(
                f"{', '.join(sorted(new.keys() & KNOWN))} on {topic} was left out: it was not "
                f"logged at the instants of {found.channels[base].topic}."
            )
    topic = found.channels[base].topic
    return Table(path.name, columns, lambda k: f"message {k + 1} on {topic}", warnings)


def _columns(
    path: Path, topic: str, messages: list[tuple[int, bytes]], decode: Decoder
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    messages = sorted(messages, key=lambda m: m[0])
    rows: list[Mapping[str, Any]] = []
    for k, (_, payload) in enumerate(messages):
        try:
            rows.append(decode(payload))
        except Exception as error:  # whatever the decoders of other formats raise
            raise RecordingError(
                f"{path}: message {k + 1} on {topic} cannot be decoded: {error}.",
                cause="the file is damaged, or its schema is not the one of its messages.",
                fix="write the file again with the program that made it",
            ) from error
    names = [n for n, v in rows[0].items() if isinstance(v, int | float)]
    columns = {name: np.array([_number(row.get(name)) for row in rows]) for name in names}
    return np.array([m[0] for m in messages], dtype=np.int64), columns


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _decoder(channel: Channel, schema: Schema | None, undecoded: list[str]) -> Decoder | None:
    if channel.message_encoding == "json":
        return _json_object
    if channel.message_encoding == "protobuf" and schema is not None:
        try:
            return _protobuf_decoder(schema)
        except ImportError:
            undecoded.append(f"{channel.topic} (protobuf; pip install protobuf to read it)")
        except Exception as error:  # protobuf's errors have no common base
            undecoded.append(f"{channel.topic} (its schema is no protobuf: {error})")
        return None
    undecoded.append(f"{channel.topic} ({channel.message_encoding or 'no encoding named'})")
    return None


def _json_object(payload: bytes) -> Mapping[str, Any]:
    value = json.loads(payload)
    return value if isinstance(value, dict) else {}


def _protobuf_decoder(schema: Schema) -> Decoder:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool = descriptor_pool.DescriptorPool()
    waiting = {file.name: file for file in files.file}

    def add(name: str) -> None:
        file = waiting.pop(name, None)
        if file is not None:
            for needed in file.dependency:
                add(needed)
            pool.Add(file)

    for name in list(waiting):
        add(name)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    fields = [field.name for field in kind.DESCRIPTOR.fields]

    def decode(payload: bytes) -> Mapping[str, Any]:
        message = kind.FromString(payload)
        return {name: getattr(message, name) for name in fields}

    return decode


def _topics(found: Scan) -> str:
    listed = [
        f"{c.topic} ({getattr(found.schemas.get(c.schema_id), 'name', '') or c.message_encoding})"
        for c in found.channels.values()
    ]
    return ", ".join(listed[:12]) + (f" and {len(listed) - 12} more" if len(listed) > 12 else "")
