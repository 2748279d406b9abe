"""Times of recording and reading, for `make bench` and the tests."""

from __future__ import annotations

import time
from pathlib import Path

from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.profile import default_profile
from tests.recording.make import flight, tick


def append_seconds(path: Path, ticks: int = 20000) -> list[float]:
    """Time of `RecordingWriter.append` in each period, s, with the recorder running."""
    rows = [tick(k) for k in range(ticks)]
    costs: list[float] = []
    with RecordingWriter(path, default_profile(), force=True) as writer:
        for row in rows:
            start = time.perf_counter()
            writer.append(row)
            costs.append(time.perf_counter() - start)
            time.sleep(1e-5)  # lets the recorder's thread in, as a real loop does
    return costs


def read_seconds(path: Path, repeats: int = 11) -> list[float]:
    """Times to read 60 s at 500 Hz into arrays, s."""
    from heli3dof.recording.write import write_recording

    write_recording(flight(30000), path, force=True)
    costs: list[float] = []
    for _ in range(repeats):
        start = time.perf_counter()
        read_recording(path)
        costs.append(time.perf_counter() - start)
    return costs
