"""The index at a file's end: found again in the file, right by another program's reading."""

from __future__ import annotations

import io
import os
import threading
import tracemalloc
from pathlib import Path
from typing import BinaryIO

import pytest
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import ChunkIndex
from mcap.stream_reader import StreamReader

from heli3dof.errors import RecordingError
from heli3dof.recording.mcap_files.chunk_index import BATCH, chunk_indexes
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.mcap_writer import SUMMARY_BYTES, McapFile
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.mcap_files.recover import recover
from heli3dof.recording.mcap_files.schema import RowFormat
from heli3dof.recording.write import write_recording
from heli3dof.rig.profile import default_profile
from tests.recording.make import flight, tick

FORM = RowFormat()


def rows(first: int, n: int) -> bytes:
    """Rows whose log times are their numbers."""
    made = FORM.empty(n)
    for layout in FORM.layouts:
        made[layout.name]["log_time"] = range(first, first + n)
    return made.tobytes()


def write(stream: BinaryIO, sizes: list[int]) -> McapFile:
    """A file of chunks with so many rows each, and a metadata record between two of them."""
    file = McapFile(stream, FORM)
    file.start({"first": {}})
    for i, n in enumerate(sizes):
        file.write_chunk(rows(10 * i, n))
        if i == 1:
            file.add_metadata("between", {"x": 1})
    file.finish()
    return file


def indexes_in(data: bytes) -> list[ChunkIndex]:
    """The index that the file ends with."""
    summary = make_reader(io.BytesIO(data), validate_crcs=True).get_summary()
    assert summary is not None
    return summary.chunk_indexes


def test_every_chunk_is_where_its_index_says() -> None:
    stream = io.BytesIO()
    sizes = [7, 1, 90, 3]
    write(stream, sizes)
    data = stream.getvalue()
    indexes = indexes_in(data)
    assert [i.uncompressed_size // FORM.stride for i in indexes] == sizes
    assert [(i.message_start_time, i.message_end_time) for i in indexes] == [
        (10 * k, 10 * k + n - 1) for k, n in enumerate(sizes)
    ]
    for index, n in zip(indexes, sizes, strict=True):
        at, length = index.chunk_start_offset, index.chunk_length
        assert data[at] == Opcode.CHUNK
        assert int.from_bytes(data[at + 1 : at + 9], "little") == length - 9
        assert data[at + 41 : at + 45] == index.compression.encode() == b"zstd"
        assert int.from_bytes(data[at + 45 : at + 53], "little") == index.compressed_size
        assert list(index.message_index_offsets) == [1, 2]
        for channel, offset in index.message_index_offsets.items():
            assert data[offset] == Opcode.MESSAGE_INDEX
            assert int.from_bytes(data[offset + 9 : offset + 11], "little") == channel
            assert int.from_bytes(data[offset + 11 : offset + 15], "little") == 16 * n
        # The next record follows the message indexes immediately.
        after = data[at + length + index.message_index_length]
        assert after in (Opcode.CHUNK, Opcode.METADATA, Opcode.DATA_END)


def test_the_index_of_a_long_file_is_written_in_parts_with_right_checksums() -> None:
    stream = io.BytesIO()
    n = 4 * BATCH + 5
    file = write(stream, [1] * n)
    data = stream.getvalue()
    indexes = indexes_in(data)
    assert len(indexes) == n == file.chunk_count
    assert len(indexes) * 50 > SUMMARY_BYTES // 2, "more than one piece"
    assert [i.message_start_time for i in indexes] == [10 * k for k in range(n)]
    assert len(list(StreamReader(io.BytesIO(data), validate_crcs=True).records)) > n
    messages = make_reader(io.BytesIO(data)).iter_messages(starting_at=5000, ending_before=5011)
    assert [m.log_time for _, _, m in messages] == [5000, 5000, 5010, 5010]


def test_a_pipe_gets_no_index(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got: list[bytes] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_bytes()))
    reader.start()
    r = flight(400)
    write_recording(r, pipe, force=True)
    reader.join(20)
    assert indexes_in(got[0]) == []
    copy = tmp_path / "a.mcap"
    copy.write_bytes(got[0])
    assert (read_recording(copy).angle == r.angle).all()
    messages = list(make_reader(io.BytesIO(got[0])).iter_messages())
    assert len(messages) == 2 * len(r), "another program reads it from end to end"


def test_a_file_over_an_older_one_has_its_index_too(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(bytes(1_000_000))
    with RecordingWriter(path, default_profile(), force=True) as writer:
        for k in range(200):
            writer.append(tick(k))
    assert sum(i.uncompressed_size for i in indexes_in(path.read_bytes())) == 200 * FORM.stride


def test_a_file_that_lost_data_is_reported_as_torn_and_recovers(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, default_profile())
    for k in range(400):
        writer.append(tick(k))
    writer._closing.set()
    writer._thread.join()
    os.truncate(path, path.stat().st_size - 10_000)  # as a network drive may, in mid-flight
    with pytest.raises(RecordingError, match="no longer contains") as caught:
        writer.close()
    assert caught.value.fix == f"heli3dof recover {path}"
    assert recover(path).samples > 0


def test_reading_chunk_heads_leaves_the_stream_at_its_end() -> None:
    stream = io.BytesIO()
    file = McapFile(stream, FORM)
    file.start({})
    first = file.good
    for k in range(3):
        file.write_chunk(rows(k, 2))
    for _ in chunk_indexes(stream, (first, file.good), 3, FORM):
        assert stream.tell() == file.good


@pytest.mark.parametrize("harm", ["cut", "zeros", "one chunk less"])
def test_indexing_a_file_without_the_written_data_raises_an_error(harm: str) -> None:
    stream = io.BytesIO()
    file = McapFile(stream, FORM)
    file.start({})
    first = file.good
    for k in range(3):
        file.write_chunk(rows(k, 20))
    data = bytearray(stream.getvalue())
    if harm == "cut":
        del data[first + 30 :]
    elif harm == "zeros":
        data[first + 30 :] = bytes(len(data) - first - 30)
    count = 4 if harm == "one chunk less" else 3
    with pytest.raises(OSError, match="no longer contains"):
        list(chunk_indexes(io.BytesIO(data), (first, file.good), count, FORM))


def test_a_thousand_chunks_leave_nothing_in_memory(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("x+b", buffering=0) as stream:
        file = McapFile(stream, FORM)
        file.start({})
        held = []
        tracemalloc.start()
        try:
            for k in range(1, 1501):
                file.write_chunk(rows(k, 2))
                if k in (500, 1500):
                    held.append(tracemalloc.get_traced_memory()[0])
        finally:
            tracemalloc.stop()
        file.finish()
    # Other work of this process may keep some bytes, but not so many.
    assert held[1] - held[0] < 20_000, "56 bytes a chunk would be 56000"
