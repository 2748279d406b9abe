"""A full, slow or faulty disk: the data that the recorder keeps, and its message."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from heli3dof.errors import NoSpace, RecordingError
from heli3dof.recording.mcap_files import flight_recorder as writer_module
from heli3dof.recording.mcap_files import fsync
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.mcap_writer import MAGIC, McapFile
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.recording.mcap_files.recover import recover
from heli3dof.rig.profile import default_profile
from tests.profiles import END_S
from tests.recording.make import tick


def full_after(writes: int):
    """McapFile.write_chunk that finds the disk full after some chunks."""
    real = McapFile.write_chunk
    done = 0

    def write_chunk(self: McapFile, data: bytes) -> None:
        nonlocal done
        done += 1
        if done > writes:
            self._stream.write(data[:100])  # the part that fits is written: a torn chunk
            raise OSError(errno.ENOSPC, "No space left on device")
        real(self, data)

    return write_chunk


def test_a_full_disk_is_reported_to_the_loop_and_earlier_rows_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(McapFile, "write_chunk", full_after(2))
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, default_profile())
    k = 0
    with pytest.raises(NoSpace, match="no space left") as caught:  # noqa: PT012
        while k < 20000:
            writer.append(tick(k))
            k += 1
            time.sleep(1e-4)
    assert k < 20000, "the error reached the loop in flight"
    assert "df -h" in caught.value.fix
    with pytest.raises(NoSpace):
        writer.close()
    r = read_recording(path)  # outcome and summary fitted once the torn chunk was cut off
    assert 0 < len(r) <= k
    np.testing.assert_array_equal(r.t, np.arange(len(r)) * 0.002)
    assert r.meta["outcome_details"]["rows_lost"] == k - len(r)


FILL = """
import resource, sys
from heli3dof.errors import NoSpace
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.rig.profile import default_profile
from tests.recording.make import tick
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
writer = RecordingWriter(sys.argv[1], default_profile())
try:
    for k in range(40_000):
        writer.append(tick(k))
    writer.close()
except NoSpace:  # from an append, or where all were taken first, from close
    try:
        writer.close()
    except NoSpace:
        pass
    print("NoSpace")
"""


def test_on_a_full_file_system_the_file_is_complete_or_recoverable(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    done = subprocess.run(
        [sys.executable, "-c", FILL, str(path)], capture_output=True, text=True, timeout=END_S
    )
    assert done.stdout.strip() == "NoSpace", done.stderr
    try:
        r = read_recording(path)
    except RecordingError:
        r = read_recording(recover(path).path)
    assert 80_000 < path.stat().st_size <= 100_000, "all but the last chunk or two fitted"
    assert len(r) > 0
    np.testing.assert_array_equal(r.t, np.arange(len(r)) * 0.002)


def until(true: Callable[[], bool], seconds: float = END_S) -> bool:
    deadline = time.monotonic() + seconds
    while not true() and time.monotonic() < deadline:
        time.sleep(0.005)
    return true()


def test_the_file_is_synchronised_during_the_flight(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    synced: list[int] = []
    monkeypatch.setattr(fsync, "_sync", lambda fd: synced.append(path.stat().st_size))
    with RecordingWriter(path, default_profile()) as writer:
        for k in range(3):
            size, n = path.stat().st_size, len(synced)
            writer.append(tick(k))
            assert until(lambda: len(synced) > n and synced[-1] > size)  # noqa: B023
    assert len(synced) < 10, "only when there is something new"


def test_a_slow_disk_delays_neither_loop_nor_recorder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.mcap"
    go = threading.Event()
    monkeypatch.setattr(fsync, "_sync", lambda fd: go.wait(2 * END_S))
    with RecordingWriter(path, default_profile()) as writer:
        for k in range(4):
            size = path.stat().st_size
            writer.append(tick(k))
            assert until(lambda: path.stat().st_size > size)  # noqa: B023
        go.set()
    assert path.read_bytes().endswith(MAGIC)


def test_a_failed_synchronisation_is_reported_to_the_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(fd: int) -> None:
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(fsync, "_sync", broken)
    writer = RecordingWriter(tmp_path / "a.mcap", default_profile())
    writer.append(tick(0))
    assert until(lambda: writer._failure is not None)
    with pytest.raises(RecordingError, match="Input/output error"):
        writer.append(tick(1))
    with pytest.raises(RecordingError):
        writer.close()


def test_a_file_that_cannot_be_synchronised_is_no_failure() -> None:
    read, write = os.pipe()
    syncer = fsync.Syncer(write)
    syncer.written()
    syncer.close()
    os.close(read), os.close(write)
    assert syncer.failure is None


def test_a_recorder_that_falls_behind_raises_an_error_before_memory_fills(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    go = threading.Event()
    real = McapFile.write_chunk

    def stuck(self: McapFile, data: bytes) -> None:
        go.wait(END_S)
        real(self, data)

    monkeypatch.setattr(McapFile, "write_chunk", stuck)
    monkeypatch.setattr(writer_module, "MAX_WAITING_ROWS", 500)
    path = tmp_path / "a.mcap"
    writer = RecordingWriter(path, default_profile())
    k = 0
    with pytest.raises(RecordingError, match="is too slow: 500 samples wait"):  # noqa: PT012
        for k in range(5000):
            writer.append(tick(k))
            time.sleep(1e-4)
    go.set()
    writer.close()
    assert len(read_recording(path)) == k, "what was taken is kept"
