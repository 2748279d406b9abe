"""Work shared between threads, and how far it has come.

The compiled passes let go of Python's lock, so threads run side by side: one for each core, `MOST`
at most. Work within work is shared too: whoever shares out pieces does them itself, and asks before
each whether a hand is free, as one is where other work ran out of pieces. No result depends on how
many hands there are.

Whoever wants to tell a person how far a long piece of work has come puts it under `watched`.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Generic, TypeVar

MOST = 4
"""More cores than this are left to others: memory grows with each, and Python's lock is one."""
Watcher = Callable[[str, int, int], None]
"""Told what is being counted, how many of it are done, and of how many."""
X = TypeVar("X")
_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


def hands() -> int:
    """Threads at once: the cores that this process may use."""
    may = getattr(os, "sched_getaffinity", None)
    return min(MOST, len(may(0)) if may else os.cpu_count() or 1)


class _Free:
    """Further hands that have nothing to do; how many there are is asked at first use."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._semaphore: threading.Semaphore | None = None

    def _count(self) -> threading.Semaphore:
        with self._lock:
            if self._semaphore is None:
                self._semaphore = threading.Semaphore(hands() - 1)
            return self._semaphore

    def take(self, *, wait: bool) -> bool:
        return self._count().acquire(blocking=wait)

    def give_back(self) -> None:
        self._count().release()


_free = _Free()


@contextmanager
def watched(watcher: Watcher | None) -> Iterator[None]:
    """Inside, ``watcher`` is told of every piece that `in_threads` has done; not of its parts."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def in_threads(work: Callable[[int], X], count: int, *, what: str = "") -> list[X]:
    """``work(0)`` … ``work(count − 1)`` by as many hands as are free; their results in order.

    ``what`` names the pieces, in the plural; without it nobody is told. Raises what the first of
    the pieces that failed raised.
    """
    pieces = _Pieces(work, count, what)
    helpers: list[threading.Thread] = []
    with watched(None):
        while pieces.left:
            while pieces.left > 1 and _free.take(wait=False):
                helpers.append(threading.Thread(target=pieces.help, daemon=True))
                helpers[-1].start()
            pieces.do_one()
    if any(h.is_alive() for h in helpers):
        _free.give_back()  # what the others are at may have parts
        for h in helpers:
            h.join()
        _free.take(wait=True)
    return pieces.results()


class _Pieces(Generic[X]):
    """The pieces of one piece of work."""

    def __init__(self, work: Callable[[int], X], count: int, what: str) -> None:
        self._work, self._count, self._what = work, count, what
        self._watcher = _watcher.get()
        self._next = self._finished = 0
        self._lock = threading.Lock()
        self._out: dict[int, X] = {}
        self._failed: dict[int, BaseException] = {}

    @property
    def left(self) -> int:
        """Pieces that nobody has begun."""
        return 0 if self._failed else self._count - self._next

    def help(self) -> None:
        """A further hand, until nothing is left."""
        try:
            while self.left:
                self.do_one()
        finally:
            _free.give_back()

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
