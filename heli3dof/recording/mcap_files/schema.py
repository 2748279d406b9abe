"""Layouts of a recording's messages, which are both valid protobuf and packed structs.

All fields have fixed width and are written in the order of their numbers, each after its tag. So
all messages of a type have the same length and the same tags between their values. One
``struct.pack`` encodes a row (defined below), one ``np.frombuffer`` decodes all rows. Any protobuf
library reads the messages with the schema in the file. A tag has one byte for field numbers below
16, else two::

    tag = field number << 3 | wire type      wire type 1: 8 bytes, 5: 4 bytes, little-endian

A row of the recording is one message of each type with the same log time. Row k contains:

* sample k
* the command computed from it
* the voltage that the device reports for the time from k to k+1, which arrives with sample k+1

Units are s, V, A, rad.
"""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from mcap.opcode import Opcode

if TYPE_CHECKING:
    from heli3dof.recording.row import Row

FORMAT = "heli3dof.recording/1"
"""Name of the format in every file's provenance; its number rises if a field changes its meaning"""

PACKAGE = "heli3dof"
MESSAGE_HEADER = (
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("mcap_sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
)
"""Fields at the head of an MCAP Message record; ``length`` counts the bytes from ``channel`` on"""

_HALF, _MASK = 1 << 31, (1 << 32) - 1
STRUCT_CODES = {"|u1": "B", "<u2": "H", "<u4": "I", "<i4": "i", "<u8": "Q", "<f8": "d"}
# kind: (protobuf's FieldDescriptorProto.Type, wire type, numpy's type)
KINDS = {"double": (1, 1, "<f8"), "fixed32": (7, 5, "<u4"), "sfixed32": (15, 5, "<i4")}


@dataclass(frozen=True, slots=True)
class Column:
    """A field of a message: its name with unit, and its type ``kind`` (a key of ``KINDS``)."""

    name: str
    kind: str = "double"
    proto_name: str | None = None
    """The field's name in the protobuf schema; None: ``name``"""


def _columns(names: str, kind: str = "double") -> tuple[Column, ...]:
    return tuple(Column(name, kind) for name in names.split())


@dataclass(frozen=True)
class Layout:
    """A message type: its name, its MCAP topic, and its fields, numbered from 1 in order."""

    name: str
    topic: str
    columns: tuple[Column, ...]
    about: dict[str, str] = field(default_factory=dict)
    """Metadata of the MCAP channel"""

    @property
    def full_name(self) -> str:
        return f"{PACKAGE}.{self.name}"

    @cached_property
    def payload(self) -> np.dtype:
        """Return numpy's structured type of a message's payload: protobuf tags and values."""
        fields: list[tuple[str, str]] = []
        for number, column in enumerate(self.columns, 1):
            tag = "u1" if number < 16 else "<u2"
            fields += [(f"tag{number}", tag), (column.name, KINDS[column.kind][2])]
        return np.dtype(fields)

    @cached_property
    def record(self) -> np.dtype:
        """Return numpy's type of an MCAP Message record: header and payload."""
        descr = [(name, self.payload.fields[name][0].str) for name in self.payload.names or ()]  # type: ignore[index]
        return np.dtype([*MESSAGE_HEADER, *descr])

    @cached_property
    def descriptor_set(self) -> bytes:
        """Return the message's schema for the MCAP file: protobuf's FileDescriptorSet as bytes."""
        fields = b"".join(
            _bytes(
                2,
                _bytes(1, (column.proto_name or column.name).encode())
                + _varint(3, number)
                + _varint(4, 1)  # LABEL_OPTIONAL
                + _varint(5, KINDS[column.kind][0]),
            )
            for number, column in enumerate(self.columns, 1)
        )
        message = _bytes(1, self.name.encode()) + fields
        file = (
            _bytes(1, f"{PACKAGE}/{self.name}.proto".encode())
            + _bytes(2, PACKAGE.encode())
            + _bytes(4, message)
            + _bytes(12, b"proto3")
        )
        return _bytes(1, file)


SAMPLE = Layout(
    "Sample",
    "/heli3dof/sample",
    _columns("t_s device_time_s lateness_s roll_rad pitch_rad yaw_rad")
    + _columns("roll_count pitch_count yaw_count", "sfixed32")
    + _columns("v_front_V v_back_V i_front_A i_back_A")
    + _columns("flags sequence", "fixed32"),
)
COMMAND = Layout(
    "Command",
    "/heli3dof/command",
    _columns("host_time_s roll_ref_rad pitch_ref_rad yaw_ref_rad")
    + _columns("roll_ref_limited_rad pitch_ref_limited_rad yaw_ref_limited_rad")
    + _columns("v_front_cmd_V v_back_cmd_V v_front_sent_V v_back_sent_V")
    + _columns("v_front_extra_V v_back_extra_V")
    + _columns("command_sequence phase", "fixed32"),
)
CHANNELS_TOPIC = "/heli3dof/channels"
MAX_CHANNELS = 2000
"""Largest number of fields in a message; their tags have at most two bytes."""


def channels_layout(names: Sequence[str]) -> Layout:
    """Return the layout of the message type Channels, which holds a recording's extra columns.

    ``names``: the recording's columns that have no field in the other two message types, `SAMPLE`
    and `COMMAND`. Numpy arrays call the fields of Channels ``column1``, ``column2`` …. The protobuf
    schema uses ``names``, changed to names that protobuf allows. The MCAP channel's metadata lists
    the unchanged names as JSON.
    """
    columns: list[Column] = []
    taken: set[str] = set()
    for number, name in enumerate(names, 1):
        clean = re.sub(r"\W", "_", name, flags=re.ASCII)
        if not re.match(r"[A-Za-z_]", clean) or clean.lower() in taken:
            clean = f"column{number}_{clean}"
        taken.add(clean.lower())
        columns.append(Column(f"column{number}", "double", clean))
    return Layout("Channels", CHANNELS_TOPIC, tuple(columns), {"columns": json.dumps(list(names))})


class RowFormat:
    """Byte format of a row of a recording: one MCAP Message record for each message type.

    The message types are Sample on MCAP channel 1, Command on channel 2 and Channels on channel 3.
    ``names``: the recording's columns that are fields of neither Sample nor Command; they are the
    fields of Channels. Without ``names``, a row has no message of the type Channels.
    """

    def __init__(self, names: Sequence[str] = ()) -> None:
        self.layouts = (SAMPLE, COMMAND, *([channels_layout(names)] if names else []))
        self.dtype = np.dtype([(layout.name, layout.record) for layout in self.layouts])
        self.stride = self.dtype.itemsize
        self.offsets = tuple(self.dtype.fields[x.name][1] for x in self.layouts)  # type: ignore[index]
        self.template = np.zeros(1, self.dtype)
        free = np.full(self.stride, 1, np.uint8)
        for channel, layout in enumerate(self.layouts, 1):
            length = layout.record.itemsize - 9  # the bytes after opcode and length
            constants = {"opcode": Opcode.MESSAGE, "length": length, "channel": channel}
            for number, column in enumerate(layout.columns, 1):
                constants[f"tag{number}"] = tag_value(number, column.kind)
            for name, value in constants.items():
                self.template[layout.name][name] = value
                free.view(self.dtype)[layout.name][name] = 0
        self._fixed_at = np.flatnonzero(free == 0)
        self._fixed_bytes = self.template.view(np.uint8)[self._fixed_at]

    def empty(self, n: int) -> np.ndarray:
        """Return ``n`` rows as a structured array in which only the constant bytes are set.

        The constant bytes are opcode, length and channel in the header of each message, and the
        protobuf tag of each field. All other bytes are zero.
        """
        return np.repeat(self.template, n)

    def parse(self, data: bytes | memoryview) -> np.ndarray | None:
        """Return the rows in ``data`` as a structured array; None if ``data`` has another format.

        The format is wrong if ``data`` is not a whole number of rows, or if a constant byte of the
        message headers and protobuf tags differs.
        """
        if len(data) % self.stride:
            return None
        raw = np.frombuffer(data, np.uint8).reshape(-1, self.stride)
        if not (raw[:, self._fixed_at] == self._fixed_bytes).all():
            return None
        return np.frombuffer(data, self.dtype)


def message_values(row: Row) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Return the values of the messages Sample and Command for a row, in the order of their fields.

    Encoder counts wrap to signed 32 bits.
    """
    sample = row.sample
    roll, pitch, yaw = sample.counts
    return (
        row.t, sample.device_time_s, row.lateness, *row.angle,
        ((roll + _HALF) & _MASK) - _HALF, ((pitch + _HALF) & _MASK) - _HALF,
        ((yaw + _HALF) & _MASK) - _HALF,
        *row.applied, *sample.current, int(sample.flags) & _MASK, sample.sequence & _MASK,
    ), (
        sample.host_time_s, *row.reference, *row.limited, *row.command, *row.voltage,
        *row.extra, row.command_sequence & _MASK, row.phase,
    )  # fmt: skip


class RowPacker:
    """Packs a control period's sample and command as bytes, by one ``struct.pack`` (about 2 µs)."""

    def __init__(self) -> None:
        rows = RowFormat()
        leaves = [
            layout.record[i]
            for layout in rows.layouts
            for i in range(len(layout.record.names or ()))
        ]
        self._pack = struct.Struct("<" + "".join(STRUCT_CODES[t.str] for t in leaves)).pack
        self._template = [v for part in rows.template[0].tolist() for v in part]
        header = len(MESSAGE_HEADER)
        first = header + 1  # the first value; then every second item, tags in between
        second = header + 2 * len(SAMPLE.columns)
        self._sample = slice(first, second, 2)
        self._command = slice(second + first, None, 2)
        self._times = (slice(3, 6), slice(second + 3, second + 6))

    def __call__(
        self, k: int, log_time: int, sample: Sequence[Any], command: Sequence[Any]
    ) -> bytes:
        """Return the row with index ``k`` as bytes; ``log_time`` is in ns.

        ``sample``, ``command``: the values of these two messages, in the order of their fields.
        """
        row = self._template[:]
        row[self._times[0]] = row[self._times[1]] = (k, log_time, log_time)
        row[self._sample] = sample
        row[self._command] = command
        return self._pack(*row)


def tag_value(number: int, kind: str) -> int:
    """Return a protobuf field's tag: one or two varint bytes, read as a little-endian number.

    ``number``: the field's number; ``kind``: its type (a key of ``KINDS``).
    """
    tag = number << 3 | KINDS[kind][1]
    return tag if tag < 128 else (tag & 0x7F | 0x80) | tag >> 7 << 8


def _varint(number: int, value: int) -> bytes:
    return _raw_varint(number << 3) + _raw_varint(value)


def _bytes(number: int, data: bytes) -> bytes:
    return _raw_varint(number << 3 | 2) + _raw_varint(len(data)) + data


def _raw_varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
