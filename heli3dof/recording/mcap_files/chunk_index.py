"""Build the chunk index at the end of an MCAP file, from the heads of the chunks in the file.

An index kept in memory would grow by an entry every 0.15 s of flight, so none is kept. Each chunk's
head contains the data of its index entry, except the length of the chunk's message indexes. This
length follows from the chunk's number of rows n:

    n = uncompressed size / bytes per row        each message index has 15 + 16 n bytes

15 bytes: opcode (1 byte), length (8), channel (2), length of the entries (4). 16 bytes: time (8)
and offset (8) of a row.
"""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Iterator
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from heli3dof.recording.mcap_files.schema import RowFormat

CODEC = "zstd"
HEAD = struct.Struct(f"<BQQQQII{len(CODEC)}sQ")
"""Head of a chunk: opcode, length; first and last log time, uncompressed size, checksum, length and
name of the codec, compressed size"""
INDEX_HEAD = struct.Struct("<BQHI")
"""Head of a message index: opcode, length, channel, length of the entries"""
BATCH = 256
"""Number of chunk heads that are read before their index entries are written"""


def chunk_indexes(
    stream: BinaryIO, span: tuple[int, int], count: int, rows: RowFormat
) -> Iterator[ChunkIndex]:
    """Yield the index entry of each of the ``count`` chunks in a part of an MCAP file.

    ``stream``: the open file. ``span``: byte offsets of the part's start and end. ``rows``: byte
    format of the chunks' rows. Each time the function yields an entry, it leaves the stream's
    position at the end of the file, so that the caller can append data. Raises OSError if the file
    no longer contains these chunks.
    """
    at, end = span
    while at < end:
        batch: list[ChunkIndex] = []
        while at < end and len(batch) < BATCH:
            index, at = _at(stream, at, rows)
            if index is not None:
                batch.append(index)
        count -= len(batch)
        stream.seek(0, os.SEEK_END)
        yield from batch
    if count or at != end:
        raise _gone()


def _at(stream: BinaryIO, at: int, rows: RowFormat) -> tuple[ChunkIndex | None, int]:
    """Return the index entry of the record at byte ``at``, and the byte at which to continue.

    The entry is None if the record is not a chunk. The message indexes after a chunk are skipped.
    """
    stream.seek(at)
    head = stream.read(HEAD.size)
    if len(head) < 9 or not head[0]:
        raise _gone()
    opcode, content = struct.unpack_from("<BQ", head)
    length = 9 + content
    if opcode != Opcode.CHUNK:
        return None, at + length
    if len(head) < HEAD.size:
        raise _gone()
    _, _, start, stop, size, _, _, _, packed = HEAD.unpack(head)
    channels = len(rows.layouts)
    each = INDEX_HEAD.size + 16 * (size // rows.stride)
    index = ChunkIndex(
        message_start_time=start,
        message_end_time=stop,
        chunk_start_offset=at,
        chunk_length=length,
        message_index_offsets={c + 1: at + length + c * each for c in range(channels)},
        message_index_length=channels * each,
        compression=CODEC,
        compressed_size=packed,
        uncompressed_size=size,
    )
    return index, at + length + channels * each


def _gone() -> OSError:
    return OSError(errno.EIO, "the file no longer contains what was written")
