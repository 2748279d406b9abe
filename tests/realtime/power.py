"""A power cut in flight: age of the newest sample that is certain to be on the disk.

Rows come at 500 Hz. Between two returns of ``fdatasync`` at s[i] and s[i+1] the disk holds the n[i]
rows written before the first call. A cut just before s[i+1] loses

    s[i+1] − (time at which row n[i] was appended)
"""

from __future__ import annotations

import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from heli3dof.recording.mcap_files import fsync
from heli3dof.recording.mcap_files.flight_recorder import RecordingWriter
from heli3dof.rig.profile import default_profile
from tests.recording.make import tick

PERIOD_S = 0.002


def lost_to_a_power_cut(
    path: Path, seconds: float, *, sync: Callable[[int], object] | None = None
) -> float:
    """s that a cut at the worst moment of ``seconds`` would have lost."""
    sync = fsync._sync if sync is None else sync
    synced: list[tuple[float, int]] = []
    appended: list[float] = []
    with pytest.MonkeyPatch.context() as patch:
        writer: list[RecordingWriter] = []

        def counted(descriptor: int) -> None:
            rows = writer[0]._file.row_count
            sync(descriptor)
            synced.append((time.monotonic(), rows))

        patch.setattr(fsync, "_sync", counted)
        with RecordingWriter(path, default_profile(), force=True) as recording:
            writer.append(recording)
            start = time.monotonic()
            for k in range(round(seconds / PERIOD_S)):
                time.sleep(max(0.0, start + k * PERIOD_S - time.monotonic()))
                appended.append(time.monotonic())
                recording.append(tick(k))
    lost = [synced[0][0] - start]
    lost += [
        later - appended[min(rows, len(appended) - 1)] for (_, rows), (later, _) in pairwise(synced)
    ]
    return max(lost)
