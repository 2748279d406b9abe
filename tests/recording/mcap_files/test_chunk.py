"""Chunks are the mcap library's byte for byte, and take no more room than the first of them."""

from __future__ import annotations

import zlib

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Chunk, MessageIndex

from heli3dof.recording.mcap_files.chunk import CHUNK_BYTES, ChunkMaker
from heli3dof.recording.mcap_files.schema import RowFormat

FORM = RowFormat()
FULL = CHUNK_BYTES // FORM.stride


def rows(n: int, first: int = 0) -> bytes:
    """n rows whose times count from ``first``, and are not in order."""
    made = FORM.empty(n)
    times = first + np.roll(np.arange(n), 1)
    for layout in FORM.layouts:
        made[layout.name]["log_time"] = made[layout.name]["publish_time"] = times
    data: bytes = made.tobytes()
    return data


def by_the_library(data: bytes, packed: bytes) -> bytes:
    """The same chunk, record by record."""
    times = np.frombuffer(data, FORM.dtype)[FORM.layouts[0].name]["log_time"].tolist()
    builder = RecordBuilder()
    Chunk(
        compression="zstd", data=packed, message_start_time=min(times),
        message_end_time=max(times), uncompressed_crc=zlib.crc32(data),
        uncompressed_size=len(data),
    ).write(builder)  # fmt: skip
    for channel, offset in enumerate(FORM.offsets, 1):
        index = [(t, k * FORM.stride + offset) for k, t in enumerate(times)]
        MessageIndex(channel, index).write(builder)
    whole: bytes = builder.end()  # type: ignore[no-untyped-call]
    return whole


@settings(max_examples=40)
@given(st.lists(st.integers(1, FULL + 20), min_size=1, max_size=4), st.integers(0, 2**60))
def test_every_chunk_equals_the_librarys(sizes: list[int], first: int) -> None:
    maker = ChunkMaker(FORM)
    for n in sizes:
        data = rows(n, first)
        chunk, count, span = maker.make(memoryview(data))
        assert (count, span) == (n, (first, first + n - 1))
        length = int.from_bytes(chunk[1:9], "little") - (8 + 8 + 8 + 4 + 4 + 4 + 8)
        packed = bytes(chunk[53 : 53 + length])
        assert zstandard.ZstdDecompressor().decompress(packed, len(data)) == data
        assert bytes(chunk) == by_the_library(data, packed)


def test_rows_that_cannot_be_compressed_fit() -> None:
    data = np.random.default_rng(0).bytes(FULL * FORM.stride)
    chunk, _, _ = ChunkMaker(FORM).make(data)
    assert len(chunk) > len(data)


@pytest.mark.parametrize("sizes", [(75, 76, 77, 90, FULL), (*[75] * 300, 1, 2, 10, 75, 76, FULL)])
def test_zstd_keeps_its_buffers_for_all_sizes(sizes: tuple[int]) -> None:
    """With a known input size, zstd would reallocate for larger chunks."""
    maker = ChunkMaker(FORM)
    maker.make(rows(75))
    taken = maker._compressor.memory_size()
    for n in sizes:
        maker.make(rows(n))
        assert maker._compressor.memory_size() == taken


def test_later_chunks_use_the_first_chunks_buffer() -> None:
    maker = ChunkMaker(FORM)
    first, _, _ = maker.make(rows(FULL))
    second, _, _ = maker.make(rows(3, 7))
    assert first.obj is second.obj
