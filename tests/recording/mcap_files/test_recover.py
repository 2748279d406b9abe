"""The data restored from a torn recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.errors import OutputExists, RecordingError, UsageError
from heli3dof.recording.info import file_info
from heli3dof.recording.mcap_files.mcap_scan import decode_chunk, scan
from heli3dof.recording.mcap_files.mcap_writer import OUTCOME
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.mcap_files.recover import recover
from heli3dof.recording.mcap_files.schema import RowFormat
from heli3dof.recording.write import write_recording
from tests.recording.make import flight, write_flight

CHUNK_OPCODE = 0x06


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """A flight with further channels: every kind of record that our files have."""
    recording = flight(400)
    recording.channels["gust m/s"] = np.arange(400.0)  # type: ignore[index]
    recording.meta["outcome"] = "completed"  # type: ignore[index]
    return write_recording(recording, tmp_path_factory.mktemp("whole") / "whole.mcap")


@settings(max_examples=200, deadline=None)
@given(data=st.data())
def test_a_cut_anywhere_gives_a_prefix_or_an_error(tmp_path_factory, whole: Path, data) -> None:
    content = whole.read_bytes()
    cut = data.draw(st.integers(0, len(content) - 1))
    garbage = data.draw(st.binary(max_size=20))
    path = tmp_path_factory.getbasetemp() / "cut.mcap"
    path.write_bytes(content[:cut] + garbage)
    if path.read_bytes() == content:
        return
    good = read_recording(whole)
    try:
        result = recover(path, force=True)
    except RecordingError as error:
        assert error.fix  # noqa: PT017
        return
    back = read_recording(result.path)
    n = len(back)
    assert n == result.samples
    np.testing.assert_array_equal(back.t, good.t[:n])
    np.testing.assert_array_equal(back.angle, good.angle[:n])
    np.testing.assert_array_equal(back.channels["gust m/s"], np.arange(n))
    assert back.profile == good.profile
    assert back.meta["outcome"] == "recovered"
    assert path.read_bytes() == content[:cut] + garbage


def test_everything_before_the_tear_is_recovered(tmp_path: Path, whole: Path) -> None:
    content = whole.read_bytes()
    chunks = [(a, b) for kind, a, b in scan(content).records if kind == CHUNK_OPCODE]
    assert len(chunks) > 3
    path = tmp_path / "torn.mcap"
    path.write_bytes(content[: chunks[2][1] - 5])
    with pytest.raises(RecordingError, match="torn") as caught:
        read_recording(path)
    assert caught.value.fix == f"heli3dof recover {path}"
    result = recover(path)
    kept = sum(len(decode_chunk(content[a:b])) for a, b in chunks[:2])
    stride = RowFormat(["gust m/s"]).stride
    rows = read_recording(result.path)
    assert result.path == tmp_path / "torn.recovered.mcap"
    assert result.samples == len(rows) == kept // stride
    assert result.bytes_lost == chunks[2][1] - 5 - (chunks[2][0] - 9)
    assert rows.meta["outcome_details"]["bytes_lost"] == result.bytes_lost
    assert ["end is missing" in text for text in result.warnings] == [True]
    assert file_info(path)["warnings"] == file_info(result.path)["warnings"] == result.warnings


def test_a_cut_at_any_records_edge_keeps_every_chunk_before_it(tmp_path: Path, whole: Path) -> None:
    content = whole.read_bytes()
    result = scan(content)
    stride = RowFormat(["gust m/s"]).stride
    path = tmp_path / "cut.mcap"
    before = 0
    for kind, start, end in result.records:
        if kind == CHUNK_OPCODE:
            before += len(decode_chunk(content[start:end])) // stride
        if not before:
            continue
        for cut in (end, end + 1, end + 9):
            path.write_bytes(content[: min(cut, len(content) - 1)])
            assert recover(path, force=True).samples == before
    assert before == 400


def test_a_missing_end_loses_no_sample(tmp_path: Path, whole: Path) -> None:
    content = whole.read_bytes()
    path = tmp_path / "torn.mcap"
    path.write_bytes(content[:-1])
    result = recover(path, tmp_path / "recovered.mcap")
    back = read_recording(result.path)
    assert len(back) == 400
    assert back.digest == read_recording(whole).digest
    assert back.meta["outcome_details"]["outcome_before"] == "completed"


def test_a_damaged_chunk_is_dropped_and_counted(tmp_path: Path, whole: Path) -> None:
    content = bytearray(whole.read_bytes())
    chunks = [(a, b) for kind, a, b in scan(bytes(content)).records if kind == CHUNK_OPCODE]
    content[chunks[1][1] - 20] ^= 0xFF
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match="damaged") as caught:
        read_recording(path)
    assert "heli3dof recover" in caught.value.fix
    result = recover(path)
    assert result.chunks_damaged == 1
    assert result.bytes_lost == 0
    lost = 400 - result.samples
    assert [f"{lost} samples are missing in 1 gap" in text for text in result.warnings] == [True]
    assert file_info(result.path)["warnings"] == result.warnings
    back = read_recording(result.path)
    good = read_recording(whole)
    assert 0 < len(back) < len(good)
    assert np.isin(back.t, good.t).all()
    assert np.diff(back.t).max() > 0.1, "the gap stays a gap"


@pytest.mark.parametrize("content", [b"\0", b"\xff"], ids=["zeros", "garbage"])
@pytest.mark.parametrize("start", [-20, 30], ids=["over two chunks", "in one chunk's end"])
def test_chunks_after_unreadable_bytes_are_recovered(
    tmp_path: Path, whole: Path, start: int, content: bytes
) -> None:
    """The damage covers the head of the third chunk, with or without the end of the second."""
    data = bytearray(whole.read_bytes())
    chunks = [(a, b) for kind, a, b in scan(bytes(data)).records if kind == CHUNK_OPCODE]
    damaged = [1, 2] if start < 0 else [2]
    at = chunks[1][1] + start  # 30 bytes after the chunk are in its message indexes
    data[at : chunks[2][0] + 50] = content * (chunks[2][0] + 50 - at)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged in the middle: ") as caught:
        read_recording(path)
    assert "changed some bytes" in str(caught.value.cause)
    about = file_info(path)
    assert about["torn"], "also with a complete end"
    result = recover(path)
    lost = sum(len(decode_chunk(whole.read_bytes()[slice(*chunks[i])])) for i in damaged)
    stride = RowFormat(["gust m/s"]).stride
    assert result.samples == about["samples"] == 400 - lost // stride
    assert result.chunks_damaged == len(damaged) - 1
    assert chunks[2][1] - chunks[2][0] < result.bytes_lost < chunks[3][0] - at
    assert f"{result.bytes_lost} bytes are unreadable" in about["damage"]
    assert read_recording(result.path).meta["outcome_details"]["outcome_before"] == "completed"


def test_a_wrong_length_loses_no_sample(tmp_path: Path, whole: Path) -> None:
    """The second chunk's length covers the third chunk; both are intact."""
    data = bytearray(whole.read_bytes())
    chunks = [(a, b) for kind, a, b in scan(bytes(data)).records if kind == CHUNK_OPCODE]
    data[chunks[1][0] - 8 : chunks[1][0]] = (chunks[2][1] - chunks[1][0] + 5).to_bytes(8, "little")
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged"):
        read_recording(path)
    assert read_recording(recover(path).path).digest == read_recording(whole).digest


def test_a_damaged_summary_loses_no_sample(tmp_path: Path, whole: Path) -> None:
    data = bytearray(whole.read_bytes())
    data[-200:-100] = bytes(100)
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match="damaged in the middle"):
        read_recording(path)
    assert read_recording(recover(path).path).digest == read_recording(whole).digest


def test_samples_are_recovered_without_the_profile(tmp_path: Path, whole: Path) -> None:
    content = whole.read_bytes()
    path = tmp_path / "damaged.mcap"
    path.write_bytes(content.replace(b"heli3dof.profile", b"heli3dof.\xffrofile", 1))
    with pytest.raises(RecordingError, match="damaged"):
        read_recording(path)
    result = recover(path)
    assert result.samples == 400
    with pytest.raises(RecordingError, match="no profile") as caught:
        read_recording(result.path)
    assert "profile=" in caught.value.fix
    good = read_recording(whole)
    assert read_recording(result.path, good.profile).digest == good.digest


def test_an_intact_file_needs_no_recovery(whole: Path) -> None:
    with pytest.raises(RecordingError, match="is intact"):
        recover(whole)


def test_recovering_never_overwrites(tmp_path: Path, whole: Path) -> None:
    path = tmp_path / "torn.mcap"
    path.write_bytes(whole.read_bytes()[:-9])
    recover(path)
    with pytest.raises(OutputExists):
        recover(path)


def test_the_original_is_never_replaced(tmp_path: Path, whole: Path) -> None:
    torn, link = tmp_path / "torn.mcap", tmp_path / "link.mcap"
    torn.write_bytes(content := whole.read_bytes()[:-100])
    link.symlink_to(torn)
    for output in (torn, link):
        with pytest.raises(UsageError, match="is an input and cannot be the output") as caught:
            recover(torn, output, force=True)
        assert caught.value.exit_code == 2
    assert torn.read_bytes() == content


def test_a_file_without_samples_cannot_be_recovered(tmp_path: Path) -> None:
    content = write_flight(tmp_path / "a.mcap", 0).read_bytes()
    outcome = next(
        a
        for kind, a, b in scan(content).records
        if kind == 0x0C and OUTCOME.encode() in content[a:b]
    )
    path = tmp_path / "torn.mcap"
    path.write_bytes(content[: outcome - 9])
    with pytest.raises(RecordingError, match="ends before its first sample;"):
        recover(path)


def test_another_programs_file_is_refused_with_the_mcap_command(tmp_path: Path) -> None:
    from mcap.writer import Writer

    path = tmp_path / "other.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        channel = writer.register_channel("/imu", "json", 0)
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RecordingError, match="another program") as caught:
        recover(path)
    assert caught.value.fix.startswith("mcap recover")
