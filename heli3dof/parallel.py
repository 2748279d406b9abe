"""Threads for estimation: `parallel_map` distributes calls, `one_blas_thread` limits BLAS.

`replicate` computes Monte Carlo replications; inside `distribute`, it can do so on a cluster.

The compiled filters release Python's global lock, so threads run in parallel: one per core, at most
`MOST`. The calling thread works too, and helper threads join it. Nested calls of `parallel_map`
share this limit on threads. Results do not depend on the number of threads.
"""

from __future__ import annotations

import functools
import os
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Generic, ParamSpec, TypeVar

MOST = 4
"""Largest number of threads: each costs memory, and they compete for Python's global lock."""
Watcher = Callable[[str, int, int], None]
"""Progress callback: (name of the work items in the plural, number done, number in all)."""
Distributor = Callable[[Callable[[int], Any], int], Iterable[tuple[int, Any]]]
"""Function (work, count) → pairs (i, ``work(i)``) for i = 0 … count − 1, in any order."""
P = ParamSpec("P")
X = TypeVar("X")
_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)
_distributor: ContextVar[Distributor | None] = ContextVar("distributor", default=None)


_limit = MOST


def core_count() -> int:
    """Return the number of cores available to this process."""
    affinity = getattr(os, "sched_getaffinity", None)
    return len(affinity(0)) if affinity else os.cpu_count() or 1


def worker_count() -> int:
    """Return the number of threads to use: one per core, at most `MOST`.

    `limit_threads` can set a lower limit.
    """
    return min(_limit, core_count())


def limit_threads(count: int) -> None:
    """Let estimation and BLAS in this process use at most ``count`` threads from now on.

    A process that shares the cores with others, such as a batch worker, calls this function.
    """
    from threadpoolctl import threadpool_limits

    global _limit
    _limit = max(1, min(count, MOST))
    _free_helpers.cache_clear()
    threadpool_limits(limits=_limit, user_api="blas")


def one_blas_thread(function: Callable[P, X]) -> Callable[P, X]:
    """Decorate ``function`` so that BLAS uses one thread while it runs.

    Estimation multiplies small matrices, so more BLAS threads gain nothing. On a busy computer they
    wait for one another, which made an identification ten times slower.
    """

    @functools.wraps(function)
    def run(*args: P.args, **kwargs: P.kwargs) -> X:
        from threadpoolctl import threadpool_limits

        with threadpool_limits(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return run


@functools.cache
def _free_helpers() -> threading.Semaphore:
    """Return the semaphore that limits how many more helper threads may start."""
    return threading.Semaphore(worker_count() - 1)


@contextmanager
def report_progress(watcher: Watcher | None) -> Iterator[None]:
    """Context manager: inside it, `parallel_map` calls ``watcher`` after each finished work item.

    Work items of nested `parallel_map` calls are not reported.
    """
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def report_count(what: str, done: int, of: int) -> None:
    """Call the watcher of `report_progress`, if any: it gets ``what``, ``done`` and ``of``.

    ``done`` of ``of`` items are finished; ``what`` names them in the plural.
    """
    if (watcher := _watcher.get()) is not None:
        watcher(what, done, of)


@contextmanager
def distribute(distributor: Distributor | None) -> Iterator[None]:
    """Context manager: inside it, `replicate` uses ``distributor``; None: it uses threads."""
    token = _distributor.set(distributor)
    try:
        yield
    finally:
        _distributor.reset(token)


def replicate(work: Callable[[int], X], count: int, *, what: str = "") -> list[X]:
    """Return ``work(0)`` … ``work(count − 1)``: Monte Carlo replications with small results.

    Inside `distribute`, the distributor computes the replications, and ``work`` must be picklable
    with cloudpickle. Otherwise `parallel_map` computes them. Nested calls of `replicate` in
    ``work`` are not distributed again. ``what``: as for `parallel_map`.
    """
    distributor, watcher = _distributor.get(), _watcher.get()
    if distributor is None or count < 2:
        return parallel_map(work, count, what=what)
    out: dict[int, X] = {}
    with report_progress(None), distribute(None):
        for i, result in distributor(work, count):
            out[i] = result
            if watcher is not None and what:
                watcher(what, len(out), count)
    return [out[i] for i in range(count)]


def parallel_map(work: Callable[[int], X], count: int, *, what: str = "") -> list[X]:
    """Compute ``work(0)`` … ``work(count − 1)`` in parallel and return the results in order.

    ``what`` names the work items in the plural for `report_progress`; empty: no progress reports.
    If a call fails, no more calls start. If several fail, the error of the call with the lowest
    number is raised.
    """
    calls = _Calls(work, count, what)
    helpers: list[threading.Thread] = []
    with report_progress(None), distribute(None):
        while calls.left:
            while calls.left > 1 and _free_helpers().acquire(blocking=False):
                helpers.append(threading.Thread(target=calls.help, daemon=True))
                helpers[-1].start()
            calls.do_one()
    if any(h.is_alive() for h in helpers):
        # While this thread waits, nested calls of the helpers may start one more thread.
        _free_helpers().release()
        for h in helpers:
            h.join()
        _free_helpers().acquire()
    return calls.results()


class _Calls(Generic[X]):
    """The calls ``work(i)`` of one `parallel_map`, with their results and errors."""

    def __init__(self, work: Callable[[int], X], count: int, what: str) -> None:
        self._work, self._count, self._what = work, count, what
        self._watcher = _watcher.get()
        self._next = self._finished = 0
        self._lock = threading.Lock()
        self._out: dict[int, X] = {}
        self._failed: dict[int, BaseException] = {}

    @property
    def left(self) -> int:
        """Return the number of calls still to start; 0 after a failure, which stops all others."""
        return 0 if self._failed else self._count - self._next

    def help(self) -> None:
        try:
            while self.left:
                self.do_one()
        finally:
            _free_helpers().release()

    def do_one(self) -> None:
        with self._lock:
            if not self.left:
                return
            i = self._next
            self._next += 1
        try:
            result = self._work(i)
        except BaseException as e:
            with self._lock:
                self._failed[i] = e
            return
        with self._lock:
            self._out[i] = result
            self._finished += 1
            if self._watcher is not None and self._what:
                self._watcher(self._what, self._finished, self._count)

    def results(self) -> list[X]:
        if self._failed:
            raise self._failed[min(self._failed)]
        return [self._out[i] for i in range(self._count)]
