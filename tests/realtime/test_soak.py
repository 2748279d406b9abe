"""The growth of a soak's readings: steady growth is detected, fluctuation is not."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from tests.bench.bench_soak import GROWTH_KiB_PER_MIN
from tests.realtime.soak import Soak, growth_of, memory_KiB

MINUTES = np.arange(0, 30, 0.25 / 60)
MORE_KiB = 32 * 1024


def grown(x_KiB: np.ndarray) -> Soak:
    """The soak with these readings in half an hour."""
    return growth_of(60 * MINUTES, np.column_stack([x_KiB, np.full(len(x_KiB), 36_000.0)]), {})


def touched(per_min: float, rng: np.random.Generator) -> np.ndarray:
    """Pages of 4 KiB, touched one by one at random moments and kept."""
    return 80_000 + 4.0 * np.cumsum(rng.poisson(per_min * 0.25 / 60, len(MINUTES)))


def test_constant_memory_after_the_warm_up_is_no_growth() -> None:
    warm = np.minimum(MINUTES, 5) * 500
    flat = grown(80_000 + warm)
    assert (flat.low, flat.growth_KiB_per_min, flat.high) == (0, 0, 0)
    assert flat.first_MiB == flat.last_MiB == 82_500 / 1024
    assert flat.minutes == pytest.approx(24, abs=0.1)


def test_fluctuating_memory_is_no_growth() -> None:
    sawtooth = 80_000 + 40 * (MINUTES * 1.7 % 1)
    noise = np.random.default_rng(0).normal(0, 20, len(MINUTES))
    assert abs(grown(sawtooth + noise).high) < GROWTH_KiB_PER_MIN


def test_a_page_per_minute_is_detected() -> None:
    leak = grown(touched(1.0, np.random.default_rng(1)))
    assert 0 < leak.low < 4 < leak.high
    assert leak.high > GROWTH_KiB_PER_MIN, "exceeds the bar"


def test_a_single_large_allocation_is_detected() -> None:
    assert grown(80_000 + 288.0 * (MINUTES > 15)).high > GROWTH_KiB_PER_MIN


@pytest.mark.parametrize("per_min", [1.0, 5.0])
def test_the_interval_covers_the_truth_nine_times_in_ten(per_min: float) -> None:
    rng = np.random.default_rng(2)
    flown = [grown(touched(per_min, rng)) for _ in range(300)]
    assert np.mean([f.low <= 4 * per_min <= f.high for f in flown]) > 0.9


TAKES = f"""
import mmap, sys
print("before", flush=True); sys.stdin.readline()
more = mmap.mmap(-1, {MORE_KiB} * 1024, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
for k in range(0, len(more), mmap.PAGESIZE): more[k] = 1
print("after", flush=True); sys.stdin.readline()
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_is_read_from_the_kernel() -> None:
    """In another process, since this one reuses freed memory."""
    with subprocess.Popen(
        [sys.executable, "-c", TAKES], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as child:
        assert child.stdin is not None
        assert child.stdout is not None
        assert child.stdout.readline() == "before\n"
        before, files = memory_KiB(child.pid)
        child.stdin.write("go on\n")
        child.stdin.flush()
        assert child.stdout.readline() == "after\n"
        after, _ = memory_KiB(child.pid)
        child.stdin.close()
    assert after - before == pytest.approx(MORE_KiB, rel=0.1)
    assert files > 1000
