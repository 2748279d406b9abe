"""A flight three times as long needs no more memory: loop, recorder and link."""

from __future__ import annotations

import gc
import statistics
import sys
import time
import tracemalloc
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path

import pytest
from heli3dof_drivers.emulator.endpoint import Endpoint
from heli3dof_drivers.link.rig import LinkRig

from heli3dof.experiment.control_loop.control_period import Period
from heli3dof.recording.mcap_files.reader import read_recording
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import default_profile
from tests.drivers.emulator.still import StillDevice
from tests.drivers.link.lines import DirectLine
from tests.realtime.growth import read_in_flight

N, STRETCHES = 6000, 3
"""Rows of a stretch, and number of stretches"""
FULL = 3000
"""Rows (6 s) after which the loop's memory of the last 4 s is full"""
A_CHUNK = 93
"""Rows"""
KEPT = 56
"""bytes of each chunk: the smallest leak that a recorder has had, 0.6 bytes a row"""
BYTES_A_ROW = KEPT / A_CHUNK / 2
"""Bar: the loop's own memory varies by one to two blocks of a deque, 1.1 kB or 0.18 bytes a row
of a stretch"""


@pytest.fixture
def traced() -> Iterator[Callable[[], float]]:
    """Bytes that Python has allocated and not freed, since the first call."""

    def held() -> float:
        if not tracemalloc.is_tracing():
            tracemalloc.start()
        return tracemalloc.get_traced_memory()[0]

    gc.collect()
    yield held
    tracemalloc.stop()


def typical(held: Sequence[float]) -> float:
    """Growth over one stretch: the median ignores other allocations in one stretch."""
    return statistics.median(b - a for a, b in pairwise(held))


def test_a_flight_keeps_per_row_what_a_monitor_of_this_test_keeps_and_no_more(
    tmp_path: Path, traced: Callable[[], float]
) -> None:
    kept: list[bytes] = []

    def keeps(now: Period) -> None:
        if now.k % A_CHUNK == 0:
            kept.append(bytes(KEPT - sys.getsizeof(b"")))

    path = tmp_path / "a.mcap"
    at = [FULL + k * N for k in range(STRETCHES + 1)]
    held, outcome = read_in_flight(path, at[-1] + 1, at, traced, begin=traced, monitors=[keeps])
    assert outcome.ending == "completed"
    assert typical(held) / N == pytest.approx(KEPT / A_CHUNK, abs=BYTES_A_ROW)
    tracemalloc.stop()
    assert len(read_recording(path)) > at[-1], "all rows are in the file"


def test_exchanges_over_the_link_keep_no_memory(traced: Callable[[], float]) -> None:
    device = StillDevice(watchdog_s=1.0)
    device.plant.volts = deque(maxlen=1)  # which by default keeps every period's
    line = DirectLine(Endpoint(device))  # type: ignore[arg-type]
    rig = LinkRig(line, default_profile(), driver="test", stream=False)
    try:
        rig.arm()
        held = []
        few = N // 2
        for k in range(1, (1 + STRETCHES) * few + 1):
            rig.exchange(Command(k, 1.0, 1.0), time.monotonic())
            if k % few == 0 or k == few // 2:  # the trace begins here
                held.append(traced())
        assert typical(held[1:]) / few < BYTES_A_ROW
        assert rig.statistics.commands == (1 + STRETCHES) * few
    finally:
        rig.close()
