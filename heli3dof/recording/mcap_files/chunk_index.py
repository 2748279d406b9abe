"""Build the chunk index by reading the finished file's chunk heads.

A list kept during the flight would grow by an entry every 0.15 s. Each chunk's head contains the
data of its index entry, and the length of its message indexes follows from its rows:

    n = uncompressed size / stride        each of the message indexes: 15 + 16 n bytes

(opcode 1, length 8, channel 2, length of the entries 4; time 8 and offset 8 per row)
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
"""opcode, length; start, end, uncompressed size, checksum, codec, compressed size"""
INDEX_HEAD = struct.Struct("<BQHI")
"""A message index: opcode, length, channel, length of the entries"""
BATCH = 256
"""Chunk heads read before their index entries are written, with one seek back per batch"""


def chunk_indexes(
    stream: BinaryIO, span: tuple[int, int], count: int, rows: RowFormat
) -> Iterator[ChunkIndex]:
    """The index entry of each of the ``count`` chunks within ``span`` (bytes: from, to).

    At each yield the stream's position is its end. Raises OSError if the file does not contain what
    was written.
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
    """The index entry of the record at offset ``at``, None if it is no chunk; the next offset."""
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
