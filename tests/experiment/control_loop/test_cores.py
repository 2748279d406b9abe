"""All threads of a flight run on one core."""

from __future__ import annotations

import os
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import pytest

from heli3dof.experiment.control_loop import cores as module
from heli3dof.experiment.control_loop.cores import on_one_core, parse_cores

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux's own calls")
SEVERAL = pytest.mark.skipif(
    sys.platform == "linux" and len(os.sched_getaffinity(0)) < 3, reason="three cores are needed"
)


@pytest.fixture(autouse=True)
def own_names(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Hide other flights on this machine, and the cores that its kernel keeps free."""
    monkeypatch.setattr(module, "CLAIM", f"\0{tmp_path}-{{}}")
    monkeypatch.setattr(module, "ISOLATED", tmp_path / "isolated")


def test_the_kernels_notation_of_cores_is_parsed() -> None:
    assert parse_cores("2-3,7") == {2, 3, 7}
    assert parse_cores("5") == {5}


@SEVERAL
def test_every_thread_is_moved_to_one_core_and_back() -> None:
    go, ended = threading.Event(), threading.Event()
    thread = threading.Thread(target=lambda: (go.set(), ended.wait(10)), daemon=True)
    thread.start()
    assert go.wait(10)
    assert thread.native_id is not None
    before = os.sched_getaffinity(0)
    with ExitStack() as undo:
        result = on_one_core(undo, scheduled=True)
        assert [check.what for check in result] == ["core"]
        assert os.sched_getaffinity(0) == os.sched_getaffinity(thread.native_id) == {max(before)}
    assert os.sched_getaffinity(0) == os.sched_getaffinity(thread.native_id) == before
    ended.set()
    thread.join()


@SEVERAL
def test_two_flights_get_different_cores_and_never_the_first() -> None:
    has = sorted(os.sched_getaffinity(0))
    with ExitStack() as undo:
        taken = [module._claimed(undo) for _ in has]
        assert taken == [*has[:0:-1], None]
    with ExitStack() as undo:
        assert module._claimed(undo) == has[-1]


def test_without_scheduling_no_thread_is_moved() -> None:
    before = os.sched_getaffinity(0)
    with ExitStack() as undo:
        assert on_one_core(undo, scheduled=False) == ()
        assert os.sched_getaffinity(0) == before


def test_a_core_that_the_kernel_keeps_free_is_preferred() -> None:
    before = os.sched_getaffinity(0)
    module.ISOLATED.write_text(f"{min(before)}\n")
    with ExitStack() as undo:
        (result,) = on_one_core(undo, scheduled=False)
        assert "keeps free" in result.found
        assert os.sched_getaffinity(0) == {min(before)}
    assert os.sched_getaffinity(0) == before
