"""`McapFile`: writes an MCAP file of header, metadata, schemas, chunks of rows, and summary.

The ``mcap`` library encodes all records but the chunks, whose messages are packed rows
(`heli3dof.recording.mcap_files.chunk`). One call writes a chunk with its message indexes, so that a
killed process leaves complete chunks. Compression, checksum and disk access release the
interpreter's lock, so the control loop in the same process keeps its deadlines.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from heli3dof.recording.atomic_write import write_all
from heli3dof.recording.mcap_files.chunk import ChunkMaker, rows_of_chunk
from heli3dof.recording.mcap_files.chunk_index import chunk_indexes
from heli3dof.recording.mcap_files.schema import RowFormat

MAGIC = b"\x89MCAP0\r\n"
LIBRARY = "heli3dof"

PROFILE = "heli3dof.profile"
PROVENANCE = "heli3dof.provenance"
OUTCOME = "heli3dof.outcome"
SUMMARY_BYTES = 64 * 1024
"""bytes; the summary is written in parts of about this size."""


class McapFile:
    """Writes one recording to an unbuffered binary stream.

    If the stream can be read, `finish` adds an index of the chunks; a pipe cannot be read, so its
    output has no index. ``good`` is the byte offset after the last complete record. After a failed
    write, the caller may truncate the file at this offset.
    """

    def __init__(self, stream: BinaryIO, rows: RowFormat) -> None:
        self._stream = stream
        self._rows = rows
        self._chunks = ChunkMaker(rows)
        self._metadata: list[MetadataIndex] = []
        self._first = 0
        """Byte offset of the first chunk"""
        self._times: tuple[int, int] | None = None
        """Log time of the first and the last message, ns"""
        self.chunk_count = 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._crc = 0
        self.good = 0
        self.row_count = 0
        for number, layout in enumerate(rows.layouts, 1):
            self._schemas.append(
                Schema(number, layout.descriptor_set, "protobuf", layout.full_name)
            )
            self._channels.append(Channel(number, layout.topic, "protobuf", layout.about, number))

    def start(self, metadata: Mapping[str, Mapping[str, Any]]) -> None:
        """Write the file's beginning: magic bytes, header, ``metadata``, schemas and channels."""
        builder = RecordBuilder()
        builder.write(MAGIC)
        Header(profile="", library=LIBRARY).write(builder)
        self._put(builder)
        for name, data in metadata.items():
            self.add_metadata(name, data)
        for record in (*self._schemas, *self._channels):
            record.write(builder)
        self._put(builder)
        self._first = self.good

    def add_metadata(self, name: str, data: Mapping[str, Any]) -> None:
        """Write an MCAP Metadata record called ``name``; each value in ``data`` becomes JSON."""
        builder = RecordBuilder()
        Metadata(name, {k: to_json(v) for k, v in data.items()}).write(builder)
        offset, length = self.good, builder.count
        self._put(builder)
        self._metadata.append(MetadataIndex(offset, length, name))

    def write_chunk(self, data: bytes | memoryview) -> None:
        """Write ``data``, packed rows, as one chunk with its message indexes, in one write call."""
        chunk, rows, (start, end) = self._chunks.make(data)
        self._write(chunk)
        before = self._times or (start, end)
        self._times = min(before[0], start), max(before[1], end)
        self.chunk_count += 1
        self.row_count += rows

    def finish(self) -> None:
        """Write MCAP's summary and closing magic bytes. Raises OSError."""
        before = self.good
        try:
            self._finish()
        except OSError:
            self.good = before  # DataEnd without a summary is invalid
            raise

    def _finish(self) -> None:
        chunks = (self._first, self.good)
        builder = RecordBuilder()
        DataEnd(self._crc).write(builder)
        self._put(builder)
        self._crc = 0  # from here on, the checksum of the summary
        start = self.good
        offsets: list[SummaryOffset] = []
        groups: tuple[tuple[Opcode, Iterable[Any]], ...] = (
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes(chunks)),
            (Opcode.METADATA_INDEX, self._metadata),
        )
        for opcode, records in groups:
            group = self.good
            for record in records:
                record.write(builder)
                if builder.count > SUMMARY_BYTES:
                    self._put(builder)
            self._put(builder)
            if self.good > group:
                offsets.append(SummaryOffset(opcode, group, self.good - group))
        offset_start = self.good
        for offset in offsets:
            offset.write(builder)
        self._put(builder)
        footer = RecordBuilder()
        Footer(start, offset_start, 0).write(footer)
        head = footer.end()[:-4]  # type: ignore[no-untyped-call]  # the checksum covers the footer up to itself
        Footer(start, offset_start, zlib.crc32(head, self._crc)).write(builder)
        builder.write(MAGIC)
        self._put(builder)

    def _chunk_indexes(self, span: tuple[int, int]) -> Iterator[Any]:
        if not (self._stream.readable() and self._stream.seekable()):
            return iter(())
        return chunk_indexes(self._stream, span, self.chunk_count, self._rows)

    def _statistics(self) -> Statistics:
        start, end = self._times or (0, 0)
        return Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts={c.id: self.row_count for c in self._channels},
            chunk_count=self.chunk_count,
            message_count=self.row_count * len(self._channels),
            metadata_count=len(self._metadata),
            message_start_time=start,
            message_end_time=end,
            schema_count=len(self._schemas),
        )

    def _put(self, builder: RecordBuilder) -> None:
        self._write(memoryview(builder.end()))  # type: ignore[no-untyped-call]

    def _write(self, data: memoryview) -> None:
        write_all(self._stream, data)
        self.good += len(data)
        self._crc = zlib.crc32(data, self._crc)


def write_rows(
    stream: BinaryIO,
    form: RowFormat,
    rows: np.ndarray,
    metadata: Mapping[str, Mapping[str, Any]],
) -> None:
    """Write a complete file: metadata, rows, then the metadata record `OUTCOME`.

    ``metadata``: all metadata records by name, with `OUTCOME` (how the flight ended).
    """
    file = McapFile(stream, form)
    file.start({name: data for name, data in metadata.items() if name != OUTCOME})
    step = rows_of_chunk(form)
    for i in range(0, len(rows), step):
        file.write_chunk(rows[i : i + step].tobytes())
    file.add_metadata(OUTCOME, metadata[OUTCOME])
    file.finish()


def to_json(value: Any) -> str:
    """Return ``value`` as JSON text: numpy arrays as lists, objects without a JSON type as text."""

    def plain(x: Any) -> Any:
        return x.tolist() if isinstance(x, np.generic | np.ndarray) else str(x)

    return json.dumps(value, default=plain, ensure_ascii=False)
