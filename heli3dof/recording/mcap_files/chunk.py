"""`ChunkMaker`: encodes the n rows of an MCAP chunk as bytes, in a buffer that it reuses.

    Chunk: head, compressed rows | MessageIndex of each channel: head, n × (time, offset)

The recorder encodes seven chunks of varying size per second. Buffers of varying size would fragment
the heap. If zstd knew each chunk's size, it would fit its internal buffer (half a MiB) to this
size. It would replace the buffer when the size changed much. `ChunkMaker` therefore gives zstd only
the size `CHUNK_BYTES`, for which zstd keeps one buffer from the first chunk on.
"""

from __future__ import annotations

import zlib

import numpy as np
import zstandard
from mcap.opcode import Opcode

from heli3dof.recording.mcap_files.chunk_index import CODEC, HEAD, INDEX_HEAD
from heli3dof.recording.mcap_files.schema import RowFormat

CHUNK_BYTES = 32 * 1024
"""bytes, largest size of a chunk's uncompressed rows. Encoding 1 MiB delays the control loop by
3–6 ms, this size by less than 0.5 ms."""
LEVEL = 3
"""zstd's compression level (its default)"""
BEFORE_LENGTH = 9
"""Number of bytes of a record's opcode (1) and length (8); the length counts only later bytes"""


def rows_of_chunk(rows: RowFormat) -> int:
    """Return how many rows in the format ``rows`` fit in a chunk of `CHUNK_BYTES`, at least one."""
    return max(1, CHUNK_BYTES // rows.stride)


class ChunkMaker:
    """Encodes the rows of one recording as MCAP chunks, one after another, in a reused buffer."""

    def __init__(self, rows: RowFormat) -> None:
        self._rows = rows
        self._compressor = zstandard.ZstdCompressor(
            compression_params=zstandard.ZstdCompressionParameters.from_level(
                LEVEL, source_size=CHUNK_BYTES
            )
        )
        self._allocate(rows_of_chunk(rows))

    def make(self, data: bytes | memoryview) -> tuple[memoryview, int, tuple[int, int]]:
        """Return packed rows (`RowFormat`) encoded as an MCAP chunk.

        Returns the bytes of the chunk and its message indexes, valid until the next call; the
        number of rows; and their first and last log time in ns.
        """
        rows = np.frombuffer(data, self._rows.dtype)
        n = len(rows)
        if n > self._most:
            self._allocate(n)
        times = rows[self._rows.layouts[0].name]["log_time"]
        start, end = int(times.min()), int(times.max())
        frame = self._compressor.compressobj()
        packed = frame.compress(data) + frame.flush()
        buffer = memoryview(self._buffer)
        HEAD.pack_into(
            buffer, 0, Opcode.CHUNK, HEAD.size - BEFORE_LENGTH + len(packed), start, end, len(data),
            zlib.crc32(data), len(CODEC), CODEC.encode(), len(packed),
        )  # fmt: skip
        at = HEAD.size + len(packed)
        buffer[HEAD.size : at] = packed
        for channel, entries in enumerate(self._entries, 1):
            entries[:n, 0] = times
            index = entries[:n].reshape(-1).view("u1").data
            INDEX_HEAD.pack_into(
                buffer, at, Opcode.MESSAGE_INDEX,
                INDEX_HEAD.size - BEFORE_LENGTH + index.nbytes, channel, index.nbytes,
            )  # fmt: skip
            at += INDEX_HEAD.size
            buffer[at : at + index.nbytes] = index
            at += index.nbytes
        return buffer[:at], n, (start, end)

    def _allocate(self, rows: int) -> None:
        stride, offsets = self._rows.stride, self._rows.offsets
        self._most = rows
        self._entries = [np.empty((rows, 2), "<u8") for _ in offsets]
        for entries, offset in zip(self._entries, offsets, strict=True):
            entries[:, 1] = np.arange(rows) * stride + offset
        indexes = len(offsets) * (INDEX_HEAD.size + 16 * rows)
        self._buffer = bytearray(HEAD.size + rows * stride + rows * stride // 64 + 1024 + indexes)
