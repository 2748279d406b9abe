"""The report of real-time measures: those granted, and the commands that grant the others."""

from __future__ import annotations

import gc
import os
import sys
import threading
from pathlib import Path

import pytest

from heli3dof.experiment.control_loop import realtime_priority as module
from heli3dof.experiment.control_loop.realtime_priority import Realtime, realtime

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="Linux's own calls")


def state() -> tuple[object, ...]:
    return (
        sys.getswitchinterval(), gc.isenabled(), os.sched_getscheduler(0),
        os.sched_getparam(0).sched_priority, os.sched_getaffinity(0),
    )  # fmt: skip


def check(granted: Realtime, what: str) -> module.Check:
    return next(c for c in granted.checks if c.what == what)


@LINUX
def test_every_measure_is_undone_after_an_exception() -> None:
    before = state()
    during = []

    def fails() -> None:
        with realtime():
            during.extend(state()[:2])
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fails()
    assert during == [pytest.approx(module.SWITCH_S), False]
    assert state() == before


@LINUX
def test_the_report_of_scheduling_is_true() -> None:
    with realtime(7) as granted:
        policy = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        assert granted.scheduled == (policy == os.SCHED_FIFO)
        if granted.scheduled:
            assert os.sched_getparam(0).sched_priority == 7


@LINUX
def test_the_report_of_locked_memory_is_true() -> None:
    with realtime() as granted:
        words = Path("/proc/self/status").read_text().split()
        locked_kB = int(words[words.index("VmLck:") + 1])
        assert granted.locked == (locked_kB > 1000)
    words = Path("/proc/self/status").read_text().split()
    assert int(words[words.index("VmLck:") + 1]) == 0


@LINUX
def test_another_thread_runs_below_the_loop_and_is_put_back() -> None:
    seen: list[int] = []
    go, done = threading.Event(), threading.Event()

    def run() -> None:
        go.wait(10)
        seen.append(os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK)
        seen.append(os.sched_getparam(0).sched_priority)
        done.set()

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    with realtime() as granted:
        go.set()
        assert done.wait(10)
    thread.join()
    if granted.scheduled:
        assert seen == [os.SCHED_FIFO, module.OTHERS_PRIORITY]
    else:
        assert seen == [os.SCHED_OTHER, 0]


def refuse(*ignored: object) -> None:
    raise PermissionError(1, "Operation not permitted")


@LINUX
def test_a_refusal_is_reported_with_the_command_that_grants_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(module, "_may_lock_everything", lambda: False)
    with realtime() as granted:
        pass
    assert not granted.scheduled
    assert not granted.locked
    refused = {c.what: c for c in granted.refused}
    assert set(refused) == {"real-time scheduling", "locked memory"}
    assert "not permitted to this user" in refused["real-time scheduling"].found
    assert "sudo tee /etc/security/limits.d/heli3dof.conf" in refused["real-time scheduling"].fix
    kept = granted.to_dict()
    assert kept["scheduled"] is False
    assert [r["what"] for r in kept["refused"]] == ["real-time scheduling", "locked memory"]


@LINUX
def test_in_a_container_the_fix_is_an_option_of_the_container(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    with realtime() as granted:
        assert "--cap-add=SYS_NICE" in check(granted, "real-time scheduling").fix


def test_a_system_without_real_time_scheduling_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_setscheduler", raising=False)
    with realtime() as granted:
        result = check(granted, "real-time scheduling")
    assert result.good is None
    assert not granted.refused or granted.refused[0].what != "real-time scheduling"
