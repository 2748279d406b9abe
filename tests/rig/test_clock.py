"""The clock offset follows drift and ignores delays; instants and uptimes, computed by hand."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heli3dof.rig.clock import DRIFT, UPTIME_WRAP_S, ClockOffset, Instants, wrapped_difference_s

DT = 0.002
WAY = 150e-6
"""s that the quickest sample takes to the host"""


def test_a_punctual_stream_is_never_late() -> None:
    clock = ClockOffset(5.0, 100.0)
    late = [clock.arrived(5.0 + k * DT, 100.0 + k * DT) for k in range(1, 1000)]
    assert max(late) < 1e-9


def test_a_delayed_sample_is_late_by_its_delay_and_does_not_move_the_offset() -> None:
    clock = ClockOffset(0.0, WAY)
    for k in range(1, 500):
        clock.arrived(k * DT, k * DT + WAY)
    assert clock.arrived(1.0, 1.0 + WAY + 0.004) == pytest.approx(0.004, abs=1e-6)
    assert clock.arrived(1.002, 1.002 + WAY) == pytest.approx(0, abs=1e-6)
    assert clock.host(2.0) == pytest.approx(2.0 + WAY, abs=1e-6)


def test_the_next_sample_corrects_a_late_first_one() -> None:
    clock = ClockOffset(0.0, 0.050)
    clock.arrived(DT, DT + WAY)
    assert clock.arrived(2 * DT, 2 * DT + WAY + 0.003) == pytest.approx(0.003, abs=1e-6)


@pytest.mark.parametrize("ppm", [-5000, -100, -50, 0, 50, 99])
def test_a_drifting_clock_is_followed_for_an_hour(ppm: float) -> None:
    clock = ClockOffset(0.0, WAY)
    step = 0.1
    late = [clock.arrived(k * step, k * step * (1 + ppm * 1e-6) + WAY) for k in range(1, 36_000)]
    assert max(late) < 1e-9


def test_a_clock_slower_than_any_crystal_gives_growing_lateness() -> None:
    clock = ClockOffset(0.0, WAY)
    late = [clock.arrived(k * DT, k * DT * (1 + 300e-6) + WAY) for k in range(1, 5000)]
    assert late[-1] == pytest.approx(200e-6 * 5000 * DT, rel=1e-3)


@settings(max_examples=100, deadline=None)
@given(
    delays=st.lists(st.floats(0, 0.05), min_size=2, max_size=200),
    ppm=st.floats(-80, 80),
)
def test_lateness_is_the_delay_beyond_the_smallest_within_the_drift(
    delays: list[float], ppm: float
) -> None:
    clock = ClockOffset(0.0, WAY + delays[0])
    quickest = delays[0]
    for k, delay in enumerate(delays[1:], 1):
        device = k * DT
        host = device * (1 + ppm * 1e-6) + WAY + delay
        late = clock.arrived(device, host)
        quickest = min(quickest, delay)
        assert late >= 0
        assert late == pytest.approx(delay - quickest, abs=2 * DRIFT * device + 1e-9)


def skipped(periods: list[float], **how: float) -> list[int]:
    """Of samples taken so many periods after the first."""
    instants = Instants(DT, 5.0, **how)
    return [instants.skipped(5.0 + k * DT) for k in periods]


def test_a_regular_stream_skips_no_instant() -> None:
    assert skipped([1, 2, 3]) == [0, 0, 0]


def test_a_jump_skips_whole_periods_and_keeps_the_grid() -> None:
    assert skipped([1, 4.3, 5, 6]) == [0, 2, 0, 0]


def test_a_late_sample_belongs_to_its_own_instant() -> None:
    assert skipped([1, 2.85, 3, 4.85, 5]) == [0, 0, 0, 0, 0]


def test_the_limit_between_late_and_next_can_be_set() -> None:
    assert skipped([1, 2.95, 3.5]) == [0, 1, 0]
    assert skipped([1, 2.95, 3.5], busy=0.99) == [0, 0, 0]


def test_the_grid_is_corrected_after_a_late_first_sample() -> None:
    # It was taken 0.8 of a period late: later samples on the grid come 0.8 early.
    assert skipped([0.2, 1.2, 4.2]) == [0, 0, 2]


def test_without_creep_longer_periods_add_up_to_one() -> None:
    longer = [1.0005 * k for k in range(1, 4001)]
    assert sum(skipped(longer)) == 0
    assert sum(skipped(longer, creep=0.0)) == 2


@pytest.mark.parametrize(
    ("a_s", "b_s", "difference_s"),
    [
        (5.0, 3.0, 2.0),
        (3.0, 5.0, -2.0),
        (1.0, UPTIME_WRAP_S - 1.0, 2.0),
        (UPTIME_WRAP_S - 1.0, 1.0, -2.0),
        (UPTIME_WRAP_S / 2, 0.0, -UPTIME_WRAP_S / 2),
        (3 * UPTIME_WRAP_S + 1.0, 0.0, 1.0),
    ],
)
def test_the_difference_is_within_half_a_wrap(a_s: float, b_s: float, difference_s: float) -> None:
    assert wrapped_difference_s(a_s, b_s) == pytest.approx(difference_s)
