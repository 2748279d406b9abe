"""The kernel's workers run under SCHED_FIFO during a flight, if permitted."""

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
    """A process that plays a kernel worker, and one that does not."""
    with subprocess.Popen(["sleep", "60"]) as process:
        for pid, name in [(process.pid, "kworker/u8:1-events_unbound"), (1, "init")]:
            (tmp_path / str(pid)).mkdir()
            (tmp_path / str(pid) / "comm").write_text(name + "\n")
        (tmp_path / "self").mkdir()
        monkeypatch.setattr(module, "PROC", tmp_path)
        yield process.pid
        process.kill()


def test_workers_are_raised_and_lowered_again_or_the_command_is_reported(worker: int) -> None:
    with ExitStack() as undo:
        (result,) = raise_workers(undo)
        if result.good:
            assert os.sched_getscheduler(worker) == os.SCHED_FIFO
            assert os.sched_getparam(worker).sched_priority == PRIORITY
        else:
            assert f"sudo chrt -f -p {PRIORITY}" in result.fix
    assert os.sched_getscheduler(worker) == os.SCHED_OTHER


def test_a_refusal_is_reported_with_its_consequence_and_is_no_error(
    worker: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*ignored: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with ExitStack() as undo:
        (result,) = raise_workers(undo)
    assert result.good is None, "neither good nor bad: USB does not use workers"
    assert "a serial line is late" in result.found


def test_a_worker_that_ended_meanwhile_is_skipped(
    worker: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone(*ignored: object) -> None:
        raise ProcessLookupError(3, "No such process")

    monkeypatch.setattr(os, "sched_setscheduler", gone)
    with ExitStack() as undo:
        assert len(raise_workers(undo)) == 1


def test_without_visible_workers_there_is_no_check(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "PROC", tmp_path)
    with ExitStack() as undo:
        assert raise_workers(undo) == ()


def test_their_priority_is_between_the_loop_and_its_other_threads() -> None:
    from heli3dof.experiment.control_loop import realtime_priority

    assert realtime_priority.OTHERS_PRIORITY < PRIORITY < realtime_priority.PRIORITY
