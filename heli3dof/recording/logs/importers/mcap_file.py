"""Importer of other programs' MCAP files with the columns of docs/reference/recording.md.

The importer decodes JSON and protobuf messages; their numeric fields are the columns. The samples
are the messages of one topic: the first topic whose messages contain both motor voltages. Columns
of another topic are added only if all its log times are equal to those of the first topic. Nothing
is resampled.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Schema

from heli3dof.errors import RecordingError, listed
from heli3dof.recording.logs.importer import Importer, Table
from heli3dof.recording.mcap_files.mcap_scan import Damaged, Scan, damaged, our_format, scan
from heli3dof.recording.mcap_files.mcap_writer import MAGIC, PROFILE
from heli3dof.recording.mcap_files.schema import SAMPLE
from heli3dof.rig.log_columns import KNOWN
from heli3dof.rig.profile import Profile, profile_from_dict

Decoder = Callable[[bytes], Mapping[str, Any]]
VOLTAGES = {"v_front_V", "v_back_V"}
HEAD_BYTES = 1 << 16
"""Number of bytes that `is_foreign` reads first. In heli3dof's own files they contain its topics,
so that the rest need not be read."""
LISTED = 12
"""Largest number of topics in a message"""


def is_foreign(path: Path) -> bool:
    """Return True for a complete, undamaged MCAP file that heli3dof did not write."""
    try:
        if not path.is_file():  # reading a pipe or a device may never end
            return False
        with path.open("rb") as stream:
            head = stream.read(HEAD_BYTES)
        if not head.startswith(MAGIC) or SAMPLE.topic.encode() in head:
            return False
        content = scan(path.read_bytes())
        return content.whole and content.intact and our_format(content) is None
    except (OSError, Damaged):
        return False


def read(
    path: Path, profile: Profile | None = None, columns: str | Sequence[str] | None = None
) -> Table:
    """Return the table of another program's MCAP file; ``columns`` is not used.

    Raises RecordingError if the file is damaged or lacks required columns. ``profile`` is the
    rig's; if it is None, the file must contain a profile.
    """
    content = scan(path.read_bytes())
    try:
        table = _table(path, content)
    except Damaged as error:
        raise damaged(path, error) from error
    if profile is None and table.profile is None:
        raise RecordingError(
            f"{path} was written by another program and contains no profile of the rig.",
            cause="only heli3dof's own recordings contain one.",
            fix="add profile='PROFILE.toml'",
        )
    return table


def _table(path: Path, content: Scan) -> Table:
    messages: dict[int, list[tuple[int, bytes]]] = {}
    for number, log_time, payload in content.messages():
        messages.setdefault(number, []).append((log_time, payload))
    tables: dict[int, tuple[np.ndarray, dict[str, np.ndarray]]] = {}
    undecoded: list[str] = []
    for number, channel in content.channels.items():
        if number not in messages:
            continue
        decode = _decoder(channel, content.schemas.get(channel.schema_id), undecoded)
        if decode is not None:
            tables[number] = _columns(path, channel.topic, messages[number], decode)
    base = next((i for i, (_, c) in tables.items() if c.keys() >= VOLTAGES), None)
    if base is None:
        raise RecordingError(
            f"{path} is an MCAP file, but not a recording of a 3-DOF helicopter: no topic has "
            f"v_front_V and v_back_V. Its topics: {_topics(content)}."
            + (f" Not decoded: {'; '.join(undecoded)}." if undecoded else ""),
            cause="a recording of another system, or columns with other names.",
            fix="export it as CSV with the columns t_s,v_front_V,v_back_V,roll_deg,…, then "
            "heli3dof import that file",
        )
    warnings: list[str] = []
    joined = _joined(content, tables, base, warnings)
    topic = content.channels[base].topic
    profile = None
    if PROFILE in content.metadata:
        record = content.metadata[PROFILE].get("profile") or {}
        profile = profile_from_dict(record, source=f"the profile in {path}", recorded=True)
    return Table(path.name, joined, lambda k: f"message {k + 1} on {topic}", warnings, profile)


def _joined(
    content: Scan,
    tables: Mapping[int, tuple[np.ndarray, dict[str, np.ndarray]]],
    base: int,
    warnings: list[str],
) -> dict[str, np.ndarray]:
    """Return the columns of the topic ``base`` (a channel id) and of topics with equal log times.

    ``tables`` has the log times (ns) and columns of each topic by channel id, ``content`` the
    topics' names. Warnings are appended to ``warnings``.
    """
    log_time, columns = tables[base]
    columns = dict(columns)
    if "t_s" not in columns:
        columns["t_s"] = (log_time - log_time[0]) / 1e9
        warnings.append("The messages have no t_s; their log time was used.")
    for number, (other_time, others) in tables.items():
        if number == base:
            continue
        new = {name: v for name, v in others.items() if name not in columns}
        if np.array_equal(other_time, log_time):
            columns |= new
        elif new.keys() & KNOWN:
            warnings.append(
                f"{', '.join(sorted(new.keys() & KNOWN))} on {content.channels[number].topic} was "
                f"ignored: its log times differ from those of {content.channels[base].topic}."
            )
    return columns


def _columns(
    path: Path, topic: str, messages: list[tuple[int, bytes]], decode: Decoder
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    messages = sorted(messages, key=lambda m: m[0])
    rows: list[Mapping[str, Any]] = []
    for k, (_, payload) in enumerate(messages):
        try:
            rows.append(decode(payload))
        except Exception as error:  # decoders have no common base error
            raise RecordingError(
                f"{path}: message {k + 1} on {topic} cannot be decoded: {error}.",
                cause="the file is damaged, or its schema does not match its messages.",
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
            undecoded.append(f"{channel.topic} (its schema is not valid protobuf: {error})")
        return None
    undecoded.append(f"{channel.topic} ({channel.message_encoding or 'no encoding'})")
    return None


def _json_object(payload: bytes) -> Mapping[str, Any]:
    value = json.loads(payload)
    return value if isinstance(value, dict) else {}


def _protobuf_decoder(schema: Schema) -> Decoder:
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool = descriptor_pool.DescriptorPool()
    message_factory.GetMessages(files.file, pool)  # adds each file after those that it needs
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))
    fields = [field.name for field in kind.DESCRIPTOR.fields]

    def decode(payload: bytes) -> Mapping[str, Any]:
        message = kind.FromString(payload)
        return {name: getattr(message, name) for name in fields}

    return decode


def _topics(content: Scan) -> str:
    topics = (
        f"{c.topic} ({getattr(content.schemas.get(c.schema_id), 'name', '') or c.message_encoding})"
        for c in content.channels.values()
    )
    return listed(topics, LISTED)


IMPORTER = Importer("MCAP", (".mcap",), read, recognises=is_foreign, carries_profile=True)
