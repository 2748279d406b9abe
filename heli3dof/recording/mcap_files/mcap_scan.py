"""Find the records of a complete or damaged MCAP file; describe a file that is not an MCAP file.

The ``mcap`` library's readers stop with an exception at the first damage, such as a missing end.
Here `scan` finds all records first, and its caller decides what to do with them. After unreadable
bytes, `scan` continues at the next chunk whose checksum is right.
"""

from __future__ import annotations

import codecs
import json
import re
import struct
import threading
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from heli3dof.errors import RecordingError, quoted
from heli3dof.file_kind import no_file
from heli3dof.recording.mcap_files.chunk_index import CODEC
from heli3dof.recording.mcap_files.mcap_writer import MAGIC
from heli3dof.recording.mcap_files.schema import CHANNELS_TOPIC, RowFormat

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")  # start, end, uncompressed size, crc, length of the codec's name
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_CODEC = struct.pack("<I", len(CODEC)) + CODEC.encode()
"""The bytes of a chunk's head that name its codec"""
_CODEC_AT = _RECORD.size + _CHUNK.size - 4
"""Byte offset of `_CODEC` in a chunk"""
_FOOTER = _RECORD.pack(Opcode.FOOTER, 20)
"""Opcode and length of a footer, which is the last record"""
_FOOTER_BYTES = len(_FOOTER) + 20 + len(MAGIC)
"""bytes from a footer to the end of its file"""
_thread = threading.local()  # a decompressor is reused, and belongs to one thread
LARGEST_CHUNK = 1 << 30
"""bytes (1 GiB, a convention): a chunk whose head states a larger size is treated as damaged"""


class Damaged(Exception):
    """Raised if the content of a file is damaged, for example by the disk or a copy."""


@dataclass(frozen=True)
class Scan:
    """The positions of the records in an MCAP file's data section, as `scan` found them."""

    data: bytes
    """The whole file"""
    records: list[tuple[int, int, int]]
    """Opcode of each record, and start and end of its content as byte offsets in ``data``"""
    whole: bool
    """True if the file ends as an MCAP file must, with a footer and MCAP's magic bytes"""
    good: int
    """Byte offset after the last complete record"""
    gaps: list[tuple[int, int]]
    """Start and end of each range of unreadable bytes between two records, as byte offsets"""

    @property
    def bytes_lost(self) -> int:
        """Return the number of bytes that belong to no record."""
        tail = 0 if self.whole else len(self.data) - self.good
        return sum(end - start for start, end in self.gaps) + tail

    def of(self, opcode: int) -> Iterator[bytes]:
        """Yield the content of each record with this MCAP opcode (record type), in file order."""
        return (self.data[a:b] for kind, a, b in self.records if kind == opcode)

    @property
    def intact(self) -> bool:
        """Return False if bytes between records are unreadable or the data's checksum is wrong.

        An absent checksum counts as right.
        """
        if self.gaps:
            return False
        if not self.records or self.records[-1][0] != Opcode.DATA_END:
            return True
        _, start, end = self.records[-1]
        expected = int.from_bytes(self.data[start:end], "little")
        return expected in (0, zlib.crc32(memoryview(self.data)[: start - 9]))

    @cached_property
    def metadata(self) -> dict[str, dict[str, Any]]:
        """Return the contents of the metadata records by name, with their JSON values decoded.

        Unreadable records are skipped, so that the samples remain readable.
        """
        found: dict[str, dict[str, Any]] = {}
        for content in self.of(Opcode.METADATA):
            try:
                record = _read(Metadata, content)
            except Damaged:
                continue
            found[record.name] = {k: _from_json(v) for k, v in record.metadata.items()}
        return found

    @cached_property
    def schemas(self) -> dict[int, Schema]:
        """Return the schemas by id: those outside of chunks; if there are none, those inside."""
        return {s.id: s for s in (_read(Schema, c) for c in self._first_outside(Opcode.SCHEMA))}

    @cached_property
    def channels(self) -> dict[int, Channel]:
        """Return the channels by id: those outside of chunks; if there are none, those inside."""
        return {c.id: c for c in (_read(Channel, c) for c in self._first_outside(Opcode.CHANNEL))}

    def _first_outside(self, opcode: int) -> Iterable[bytes]:
        return list(self.of(opcode)) or self._also_in_chunks(opcode)

    def _also_in_chunks(self, opcode: int) -> Iterator[bytes]:
        """Yield the content of each record with this opcode, also inside chunks, in file order."""
        for kind, a, b in self.records:
            if kind == opcode:
                yield self.data[a:b]
            elif kind == Opcode.CHUNK:
                data = decode_chunk(self.data[a:b])
                yield from (data[c:d] for inner, c, d in records_in(data)[0] if inner == opcode)

    def messages(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield (channel id, log time in ns, payload) of every message, in the file's order."""
        return map(_message, self._also_in_chunks(Opcode.MESSAGE))


def scan(data: bytes) -> Scan:
    """Return the records in an MCAP file's bytes, which must start with MCAP's magic bytes."""
    records, good = records_in(data, len(MAGIC))
    gaps: list[tuple[int, int]] = []
    while not (whole := bool(records) and records[-1][0] == Opcode.FOOTER and data[good:] == MAGIC):
        # The last record may have a wrong length, so the search starts inside it.
        found = _next_intact(data, records[-1][1] if records else good)
        if found is None:
            break
        if found < good:
            records[-1] = (*records[-1][:2], found)
        gaps.append((min(good, found), found))
        more, good = records_in(data, found)
        records += more
    end = next((i for i, r in enumerate(records) if r[0] == Opcode.DATA_END), None)
    # The summary repeats schemas and channels without a checksum, so it is ignored.
    kept = records if end is None else records[: end + 1]
    return Scan(data, kept, whole and (end is not None or bool(gaps)), good, gaps)


def _next_intact(data: bytes, at: int) -> int | None:
    """Return the byte offset of the first intact chunk from byte ``at`` on, or else of the footer.

    The result is None if there is neither.
    """
    named = data.find(_CODEC, at + _CODEC_AT)
    while named >= 0:
        start = named - _CODEC_AT
        opcode, length = _RECORD.unpack_from(data, start)
        content = data[start + _RECORD.size : start + _RECORD.size + length]
        if opcode == Opcode.CHUNK and len(content) == length:
            try:
                decode_chunk(content)
            except Damaged:
                pass
            else:
                return start
        named = data.find(_CODEC, named + 1)
    footer = len(data) - _FOOTER_BYTES
    has_footer = footer >= at and data.startswith(_FOOTER, footer) and data.endswith(MAGIC)
    return footer if has_footer else None


def our_format(found: Scan) -> RowFormat | None:
    """Return the format of the rows in a heli3dof file; None for any other file."""
    by_topic = {c.topic: c for c in found.channels.values()}
    form = RowFormat(channel_names(found))
    for layout in form.layouts:
        channel = by_topic.get(layout.topic)
        schema = None if channel is None else found.schemas.get(channel.schema_id)
        if schema is None or schema.data != layout.descriptor_set:
            return None
    return form


def channel_names(found: Scan) -> list[str]:
    """Return the names of a recording's further columns, such as unknown columns of a log.

    heli3dof's own messages have no fields for them. Raises Damaged if the names are unreadable.
    """
    for channel in found.channels.values():
        if channel.topic == CHANNELS_TOPIC:
            try:
                names: list[str] = json.loads(channel.metadata["columns"])
                return names
            except (KeyError, json.JSONDecodeError) as error:
                raise Damaged("the names of its further channels are unreadable") from error
    return []


def records_in(data: bytes, at: int = 0) -> tuple[list[tuple[int, int, int]], int]:
    """Return the complete records from byte ``at`` on, and the byte offset after the last of them.

    They end with the first footer, or before the first incomplete or invalid record.

    A record is (opcode, offset of its content's first byte, offset of the byte after its content).
    """
    records: list[tuple[int, int, int]] = []
    size, unpack = len(data), _RECORD.unpack_from
    while at + 9 <= size:
        opcode, length = unpack(data, at)
        end = at + 9 + length
        if opcode == 0 or end > size:
            break
        records.append((opcode, at + 9, end))
        at = end
        if opcode == Opcode.FOOTER:
            break
    return records, at


def decode_chunk(content: bytes) -> bytes:
    """Return the uncompressed bytes of an MCAP chunk; raise Damaged if it cannot be read."""
    try:
        _, _, size, crc, name_length = _CHUNK.unpack_from(content)
        codec = content[32 : 32 + name_length].decode()
        packed = content[32 + name_length + 8 :]
        if size > LARGEST_CHUNK:
            raise Damaged(f"a chunk claims {size} bytes")
        data = _uncompress(codec, packed, size)
    except (struct.error, UnicodeDecodeError, zstandard.ZstdError) as error:
        raise Damaged(f"a chunk does not decompress: {error}") from error
    if len(data) != size or (crc and zlib.crc32(data) != crc):
        raise Damaged("a chunk's checksum is wrong")
    return data


def _uncompress(codec: str, packed: bytes, size: int) -> bytes:
    if codec == "":
        return packed
    if codec == "zstd":
        if zstandard.frame_content_size(packed) > size:
            raise Damaged("a chunk is longer than its header states")
        if not hasattr(_thread, "decompress"):
            _thread.decompress = zstandard.ZstdDecompressor().decompress
        data: bytes = _thread.decompress(packed, size)
        return data
    if codec == "lz4":
        from lz4 import frame

        try:
            plain: bytes = frame.decompress(packed)
        except RuntimeError as error:
            raise Damaged(f"a chunk does not decompress: {error}") from error
        return plain
    raise Damaged(f"a chunk is compressed with {codec!r}")


def _message(content: bytes) -> tuple[int, int, bytes]:
    if len(content) < _MESSAGE.size:
        raise Damaged("a message is shorter than its header")
    channel, _, log_time, _ = _MESSAGE.unpack_from(content)
    return channel, log_time, content[_MESSAGE.size :]


def _read(kind: Any, content: bytes) -> Any:
    try:
        return kind.read(ReadDataStream(BytesIO(content)))
    except (McapError, struct.error, UnicodeDecodeError) as error:
        raise Damaged(f"a {kind.__name__} record is unreadable: {error}") from error


def _from_json(text: str) -> Any:
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return text  # another program's metadata


def refuse_stream(path: Path) -> None:
    """Raise RecordingError if ``path`` is a pipe or a device: reading it may never end."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise RecordingError(
            f"{path} is a pipe or a device, not a file.",
            cause="a recording or log was given as a stream; heli3dof reads its file repeatedly.",
            fix="write the stream to a file first, and give that file",
        )


def read_bytes(path: Path) -> bytes:
    """Return a file's bytes. Raises RecordingError if it is missing or cannot be read."""
    try:
        refuse_stream(path)
        return path.read_bytes()
    except FileNotFoundError:
        raise no_file(path, "recording", RecordingError) from None
    except IsADirectoryError:
        raise RecordingError(
            f"{path} is a folder, not a recording.",
            cause="the file's name is missing after the folder.",
            fix=f"ls {quoted(path)}",
        ) from None
    except OSError as error:
        raise RecordingError(
            f"{path} cannot be read: {error.strerror}.",
            cause="you have no permission to read it, or the disk has a fault.",
            fix=f"ls -l {quoted(path)}",
        ) from error


def damaged(path: Path, error: Damaged, where: str = "") -> RecordingError:
    """Return the RecordingError to raise for the file at ``path``, which has damaged bytes.

    ``error`` states the damage; ``where`` its place, as text such as `` in the middle``.
    """
    return RecordingError(
        f"{path} is damaged{where}: {error}.",
        cause="the disk or a network copy changed some bytes.",
        fix=f"copy it again, or recover the intact part: heli3dof recover {quoted(path)}",
    )


_SIGNATURES = (
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file (possibly a MAT-file of version 7.3)"),
    (b"MATLAB 7.3", "a MAT-file of version 7.3"),
    (b"MATLAB 5.0", "a MAT-file"),
    (b"\x1f\x8b", "a gzip-compressed file"),
    (b"PK\x03\x04", "a ZIP archive or a spreadsheet"),
    (b"PAR1", "a Parquet file"),
    (b"SQLite format 3", "an SQLite database (possibly a ROS 2 bag)"),
    (b"#ROSBAG", "a ROS 1 bag"),
    (b"\x89PNG", "a PNG picture"),
    (b"%PDF", "a PDF document"),
)


_CONTROL = re.compile("[\0-\x08\x0e-\x1a\x1c-\x1f]")
"""A control character that text does not contain: all except white space and Escape"""


def what_is(data: bytes) -> str:
    """Return the kind of file that begins with the bytes ``data``, in words: ``a MAT-file``."""
    if not data:
        return "an empty file"
    for signature, name in _SIGNATURES:
        if data.startswith(signature):
            return name
    if data.startswith(MAGIC[:5]):
        return "an incomplete MCAP file, or one of another version"
    head = data[:4096]
    try:
        text = codecs.getincrementaldecoder("utf-8-sig")().decode(head)  # may end in a character
    except UnicodeDecodeError:
        text = head.decode("latin-1")
    if _CONTROL.search(text):
        return "a binary file of an unknown kind"
    line = text.split("\n", 1)[0]
    if line.lstrip().startswith(("{", "[")) and not line.count(","):
        return "text, possibly JSON or TOML"
    if any(line.count(separator) >= 2 for separator in ",;\t"):
        return "a text table, possibly CSV"
    return "text"
