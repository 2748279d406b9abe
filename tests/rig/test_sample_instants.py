"""The instant of a stream that a sample belongs to, computed by hand."""

from __future__ import annotations

from heli3dof.rig.sample_instants import Instants

DT = 0.002


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
