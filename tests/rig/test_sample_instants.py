"""Which instant of a stream a sample belongs to, by hand."""

from __future__ import annotations

from heli3dof.rig.sample_instants import Instants

DT = 0.002


def skipped(periods: list[float], **how: float) -> list[int]:
    """Of samples taken so many periods after the first."""
    instants = Instants(DT, 5.0, **how)
    return [instants.skipped(5.0 + k * DT) for k in periods]


def test_a_stream_on_its_grid_skips_nothing() -> None:
    assert skipped([1, 2, 3]) == [0, 0, 0]


def test_a_jump_of_time_is_whole_periods_and_the_grid_stays() -> None:
    assert skipped([1, 4.3, 5, 6]) == [0, 2, 0, 0]


def test_a_sample_that_was_taken_late_is_not_the_next_ones() -> None:
    assert skipped([1, 2.85, 3, 4.85, 5]) == [0, 0, 0, 0, 0]


def test_how_late_is_the_next_ones_may_be_said() -> None:
    assert skipped([1, 2.95, 3.5]) == [0, 1, 0]
    assert skipped([1, 2.95, 3.5], busy=0.99) == [0, 0, 0]


def test_a_first_sample_that_was_late_itself_is_found_out() -> None:
    # It was taken 0.8 of a period late: what follows on the grid comes 0.8 early.
    assert skipped([0.2, 1.2, 4.2]) == [0, 0, 2]


def test_without_creep_periods_that_are_longer_add_up_to_one() -> None:
    longer = [1.0005 * k for k in range(1, 4001)]
    assert sum(skipped(longer)) == 0
    assert sum(skipped(longer, creep=0.0)) == 2
