"""A flight three times as long holds no more: not the loop, not the recorder, not the link."""

from __future__ import annotations

import gc
import sys
import time
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.link.rig import LinkRig

from heli3dof.experiment.period import Period, Watch
from heli3dof.recording.reader import read_recording
from heli3dof.rig.port import Command
from heli3dof.rig.profile import default_profile
from tests.drivers.emulator.still import StillDevice
from tests.drivers.link.lines import DirectLine
from tests.realtime.growth import read_in_flight

N = 4000
FULL = 24000
"""Rows, 48 s, after which the watches' memory of the last 40 s holds all that it ever does"""
A_CHUNK = 93
"""Rows"""
KEPT = 56
"""bytes of each chunk, the least that a recorder was ever found to keep: 0.6 a row"""
BYTES_A_ROW = KEPT / A_CHUNK / 2
"""What the watches remember is bounded and not constant: one to two blocks of a deque, 1.1 kB or
0.14 bytes a row of these."""


@pytest.fixture
def traced() -> Iterator[Callable[[], float]]:
    """Bytes that Python has given out and not got back, since the first call."""

    def held() -> float:
        if not tracemalloc.is_tracing():
            tracemalloc.start()
        return tracemalloc.get_traced_memory()[0]

    gc.collect()
    yield held
    tracemalloc.stop()


def bytes_a_row(path: Path, traced: Callable[[], float], *watches: Watch) -> float:
    (before, after), outcome = read_in_flight(
        path, FULL + 2 * N + 1, (FULL, FULL + 2 * N), traced, begin=traced, watches=watches
    )
    assert outcome.ending == "completed"
    return (after - before) / (2 * N)


def _flown(path: Path, traced: Callable[[], float]) -> float:
    left = bytes_a_row(path, traced)
    tracemalloc.stop()
    assert len(read_recording(path)) > FULL + 2 * N, "and all of them are in the file"
    return left


def test_rows_that_are_flown_and_recorded_leave_nothing(
    tmp_path: Path, traced: Callable[[], float]
) -> None:
    assert _flown(tmp_path / "a.mcap", traced) < BYTES_A_ROW


def test_a_watch_that_keeps_a_little_of_every_chunk_is_seen(
    tmp_path: Path, traced: Callable[[], float]
) -> None:
    kept: list[bytes] = []

    def keeps(now: Period) -> None:
        if now.k % A_CHUNK == 0:
            kept.append(bytes(KEPT - sys.getsizeof(b"")))

    assert bytes_a_row(tmp_path / "a.mcap", traced, keeps) > BYTES_A_ROW


def test_exchanges_over_the_link_leave_nothing(traced: Callable[[], float]) -> None:
    device = StillDevice(watchdog_s=1.0)
    device.plant.volts = deque(maxlen=1)  # which else keeps every period's
    line = DirectLine(Endpoint(device))  # type: ignore[arg-type]
    rig = LinkRig(line, default_profile(), driver="test", stream=False)
    try:
        rig.arm()
        held = []
        for k in range(1, 3 * N + 1):
            rig.exchange(Command(k, 1.0, 1.0), time.monotonic())
            if k in (N // 2, N, 3 * N):  # first: the trace begins
                held.append(traced())
        assert (held[2] - held[1]) / (2 * N) < BYTES_A_ROW
        assert rig.statistics.commands == 3 * N
    finally:
        rig.close()
