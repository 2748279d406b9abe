"""Threads: order of results, progress, nesting, errors."""

from __future__ import annotations

import threading
import time
from functools import cache

import pytest

from heli3dof import parallel, stage_clock
from heli3dof.parallel import (
    distribute,
    parallel_map,
    replicate,
    report_count,
    report_progress,
)
from heli3dof.stage_clock import StageClock


def test_results_are_in_the_order_of_the_pieces() -> None:
    def slow_at_first(i: int) -> int:
        time.sleep(0.02 if i == 0 else 0.0)
        return i * i

    assert parallel_map(slow_at_first, 5) == [0, 1, 4, 9, 16]


def test_the_watcher_is_called_for_every_piece_of_named_work_only() -> None:
    reported: list[tuple[str, int, int]] = []
    with report_progress(lambda what, done, of: reported.append((what, done, of))):
        parallel_map(abs, 3, what="flights")
        parallel_map(abs, 3)
    parallel_map(abs, 3, what="flights")
    assert reported == [("flights", 1, 3), ("flights", 2, 3), ("flights", 3, 3)]


@pytest.fixture
def two_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parallel, "_free_helpers", cache(lambda: threading.Semaphore(1)))


@pytest.mark.usefixtures("two_threads")
def test_nested_work_never_uses_more_threads_than_allowed() -> None:
    at_work, most, lock = [0], [0], threading.Lock()

    def part(i: int) -> int:
        with lock:
            at_work[0] += 1
            most[0] = max(most[0], at_work[0])
        time.sleep(0.002)
        with lock:
            at_work[0] -= 1
        return i

    sums = parallel_map(lambda i: sum(parallel_map(part, 4)), 5)
    assert sums == [6] * 5
    assert most == [2]
    assert parallel_map(part, 3) == [0, 1, 2]
    assert most == [2], "a thread was not given back"


@pytest.mark.usefixtures("two_threads")
def test_a_thread_without_pieces_helps_with_nested_work() -> None:
    by: set[int] = set()

    def part(k: int) -> None:
        time.sleep(0.002)
        by.add(threading.get_ident())

    parallel_map(lambda i: [] if i else parallel_map(part, 100), 2)
    assert len(by) == 2


def test_pieces_of_nested_work_are_not_reported() -> None:
    reported: list[str] = []
    with report_progress(lambda what, done, of: reported.append(what)):
        parallel_map(lambda i: parallel_map(abs, 2, what="parts"), 2, what="pieces")
    assert reported == ["pieces"] * 2


def test_the_error_of_a_piece_is_raised() -> None:
    def breaks(i: int) -> int:
        return 1 // (2 - i)

    with pytest.raises(ZeroDivisionError):
        parallel_map(breaks, 4)
    assert parallel_map(abs, 3) == [0, 1, 2], "the next call still works"


def test_a_loop_reports_its_count_where_somebody_watches() -> None:
    seen: list[tuple[str, int, int]] = []
    report_count("models", 1, 3)  # without a watcher
    with report_progress(lambda *each: seen.append(each)):
        report_count("models", 2, 3)
    assert seen == [("models", 2, 3)]


def test_a_long_stage_reports_progress_and_a_short_one_does_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now = [0.0]
    monkeypatch.setattr(stage_clock.time, "perf_counter", lambda: now[0])
    shown: list[str] = []
    clock = StageClock(shown.append)
    clock.start("screen 1", "Screening …")
    for done, at in ((1, 0.4), (2, 0.9), (3, 1.3), (4, 1.8), (5, 2.4)):
        now[0] = at
        clock.counts("flights", done, 8)
    assert shown == [
        "Screening …",
        "Screening … flights: 3 of 8, 2 s left",  # 2 items in 0.9 s, 5 to go: 2.25 s
        "Screening … flights: 5 of 8, 2 s left",  # 4 items in 2.0 s, 3 to go: 1.5 s
    ]
    clock.stop()
    assert clock.seconds == {"screen 1": 2.4}


def backwards(work, count):
    for i in reversed(range(count)):
        yield i, work(i)


def test_replications_are_given_to_the_distributor_and_keep_their_order() -> None:
    seen: list[tuple[str, int, int]] = []
    with distribute(backwards), report_progress(lambda *state: seen.append(state)):
        assert replicate(lambda i: 10 * i, 3, what="flights") == [0, 10, 20]
    assert seen == [("flights", 1, 3), ("flights", 2, 3), ("flights", 3, 3)]
    assert replicate(lambda i: 10 * i, 3) == [0, 10, 20]


def test_only_replications_of_the_outer_level_are_distributed() -> None:
    given: list[int] = []

    def distributor(work, count):
        given.append(count)
        return backwards(work, count)

    with distribute(distributor):
        assert replicate(lambda i: sum(replicate(abs, 4)), 3) == [6, 6, 6]
        assert parallel_map(lambda i: sum(replicate(abs, 4)), 2) == [6, 6]
        assert replicate(abs, 1) == [0], "one replication is not worth sending"
    assert given == [3]
