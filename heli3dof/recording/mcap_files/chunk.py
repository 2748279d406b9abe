"""A chunk of whole rows as bytes, in room that is taken once and used for every chunk.

    Chunk: head, compressed rows | MessageIndex of channel 1: head, n × (time, offset) | of 2 …

The recorder makes seven of them a second for as long as a flight takes, of as many rows as there
are. What is taken in ever other sizes leaves a heap in pieces, and it grows. zstd is the worst of
it: told the size of its input it takes the room for just that size, half a MiB; gives it back when
a far smaller one comes, as after a standstill; and takes it anew for every one that is larger than
all before. So it is not told, and has the room of `CHUNK_BYTES` from the first chunk on.
"""

from __future__ import annotations

import zlib

import numpy as np
import zstandard
from mcap.opcode import Opcode

from heli3dof.recording.mcap_files.chunk_index import CODEC, HEAD, INDEX_HEAD
from heli3dof.recording.mcap_files.schema import RowFormat

CHUNK_BYTES = 32 * 1024
"""Larger chunks would hold up the loop: 1 MiB by 3–6 ms, this by less than 0.5 ms."""
LEVEL = 3
BEFORE_LENGTH = 9
"""Bytes of a record, opcode and length, which its length does not count"""


def rows_of_chunk(rows: RowFormat) -> int:
    """Whole rows that fit into `CHUNK_BYTES`, at least one."""
    return max(1, CHUNK_BYTES // rows.stride)


class ChunkMaker:
    """Makes the chunks of one file, one at a time."""

    def __init__(self, rows: RowFormat) -> None:
        self._rows = rows
        self._compressor = zstandard.ZstdCompressor(
            compression_params=zstandard.ZstdCompressionParameters.from_level(
                LEVEL, source_size=CHUNK_BYTES
            )
        )
        self._take(rows_of_chunk(rows))

    def make(self, data: bytes | memoryview) -> tuple[memoryview, int, tuple[int, int]]:
        """Chunk and message indexes, good until the next call; rows; first and last time, ns."""
        rows = np.frombuffer(data, self._rows.dtype)
        n = len(rows)
        if n > self._most:
            self._take(n)
        times = rows[self._rows.layouts[0].name]["log_time"]
        start, end = int(times.min()), int(times.max())
        frame = self._compressor.compressobj()
        packed = frame.compress(data) + frame.flush()
        room = memoryview(self._room)
        HEAD.pack_into(
            room, 0, Opcode.CHUNK, HEAD.size - BEFORE_LENGTH + len(packed), start, end, len(data),
            zlib.crc32(data), len(CODEC), CODEC.encode(), len(packed),
        )  # fmt: skip
        at = HEAD.size + len(packed)
        room[HEAD.size : at] = packed
        for channel, entries in enumerate(self._entries, 1):
            entries[:n, 0] = times
            index = entries[:n].reshape(-1).view("u1").data
            INDEX_HEAD.pack_into(
                room, at, Opcode.MESSAGE_INDEX,
                INDEX_HEAD.size - BEFORE_LENGTH + index.nbytes, channel, index.nbytes,
            )  # fmt: skip
            at += INDEX_HEAD.size
            room[at : at + index.nbytes] = index
            at += index.nbytes
        return room[:at], n, (start, end)

    def _take(self, rows: int) -> None:
        """The room for so many rows, were they random numbers."""
        stride, offsets = self._rows.stride, self._rows.offsets
        self._most = rows
        self._entries = [np.empty((rows, 2), "<u8") for _ in offsets]
        for entries, offset in zip(self._entries, offsets, strict=True):
            entries[:, 1] = np.arange(rows) * stride + offset
        indexes = len(offsets) * (INDEX_HEAD.size + 16 * rows)
        self._room = bytearray(HEAD.size + rows * stride + rows * stride // 64 + 1024 + indexes)
