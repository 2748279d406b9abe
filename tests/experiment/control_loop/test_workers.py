"""The kernel's workers in real time for the length of a flight, where that is permitted."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from heli3dof.experiment.control_loop import workers as module
from heli3dof.experiment.control_loop.workers import PRIORITY, raise_workers

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Linux's own calls")


@pytest.fixture
def worker(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[int]:
    """A process that stands for a kernel worker, among others that are none."""
    with subprocess.Popen(["sleep", "60"]) as process:
        for pid, name in [(process.pid, "kworker/u8:1-events_unbound"), (1, "init")]:
            (tmp_path / str(pid)).mkdir()
            (tmp_path / str(pid) / "comm").write_text(name + "\n")
        (tmp_path / "self").mkdir()
        monkeypatch.setattr(module, "PROC", tmp_path)
        yield process.pid
        process.kill()


def test_they_are_put_up_and_given_back_or_the_command_that_does_it_is_said(worker: int) -> None:
    with ExitStack() as undo:
        (found,) = raise_workers(undo)
        if found.good:
            assert os.sched_getscheduler(worker) == os.SCHED_FIFO
            assert os.sched_getparam(worker).sched_priority == PRIORITY
        else:
            assert f"sudo chrt -f -p {PRIORITY}" in found.fix
    assert os.sched_getscheduler(worker) == os.SCHED_OTHER


def test_a_refusal_is_no_error_and_says_what_it_means(
    worker: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*ignored: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with ExitStack() as undo:
        (found,) = raise_workers(undo)
    assert found.good is None, "for the user to judge: USB does without them"
    assert "a serial line is late" in found.found


def test_a_worker_that_has_ended_meanwhile_is_passed_over(
    worker: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*ignored: object) -> None:
        raise ProcessLookupError(3, "No such process")

    monkeypatch.setattr(os, "sched_setscheduler", gone)
    with ExitStack() as undo:
        assert len(raise_workers(undo)) == 1


def test_where_none_are_to_be_seen_nothing_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PROC", tmp_path)
    with ExitStack() as undo:
        assert raise_workers(undo) == ()


def test_they_stand_between_the_loop_and_what_stands_beside_it() -> None:
    from heli3dof.experiment.control_loop import realtime_priority

    assert realtime_priority.OTHERS_PRIORITY < PRIORITY < realtime_priority.PRIORITY
