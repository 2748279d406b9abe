"""Threads keep the order of things, and say how far they have come."""

from __future__ import annotations

import time

import pytest

from heli3dof.diagnosis import diagnose as stages
from heli3dof.diagnosis.diagnose import Clock
from heli3dof.diagnosis.workers import in_threads, watched


def test_results_come_in_the_order_of_the_pieces_whichever_is_done_first() -> None:
    def slow_at_first(i: int) -> int:
        time.sleep(0.02 if i == 0 else 0.0)
        return i * i

    assert in_threads(slow_at_first, 5) == [0, 1, 4, 9, 16]


def test_a_watcher_is_told_of_every_piece_of_what_has_a_name_and_of_nothing_else() -> None:
    told: list[tuple[str, int, int]] = []
    with watched(lambda what, done, of: told.append((what, done, of))):
        in_threads(abs, 3, what="flights")
        in_threads(abs, 3)
    in_threads(abs, 3, what="flights")
    assert told == [("flights", 1, 3), ("flights", 2, 3), ("flights", 3, 3)]


def test_a_piece_that_fails_fails_the_whole() -> None:
    def breaks(i: int) -> int:
        return 1 // (2 - i)

    with pytest.raises(ZeroDivisionError):
        in_threads(breaks, 4)


def test_a_long_stage_says_how_far_it_is_and_a_short_one_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(stages.time, "perf_counter", lambda: now[0])
    said: list[str] = []
    clock = Clock(said.append)
    clock.start("screen 1", "Screening …")
    for done, at in ((1, 0.4), (2, 0.9), (3, 1.3), (4, 1.8), (5, 2.4)):
        now[0] = at
        clock.counts("flights", done, 8)
    assert said == ["Screening …", "Screening … flights: 3 of 8", "Screening … flights: 5 of 8"]
    clock.stop()
    assert clock.seconds == {"screen 1": 2.4}
