"""Work shared between threads, and how far it has come.

The compiled passes let go of Python's lock, so `WORKERS` threads run side by side. Whoever wants to
tell a person how far a long piece of work has come puts it under `watched`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TypeVar

WORKERS = 2
Watcher = Callable[[str, int, int], None]
"""Told what is being counted, how many of it are done, and of how many."""
X = TypeVar("X")
_watcher: ContextVar[Watcher | None] = ContextVar("watcher", default=None)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Inside, ``watcher`` is told of every piece that `in_threads` has done."""
    token = _watcher.set(watcher)
    try:
        yield
    finally:
        _watcher.reset(token)


def in_threads(
    work: Callable[[int], X],
    count: int,
    done: Callable[[int], None] | None = None,
    *,
    what: str = "",
) -> list[X]:
    """``work(0)`` … ``work(count − 1)`` on `WORKERS` threads, in order.

    ``what`` names the pieces, in the plural; without it nobody is told.
    """
    out: list[X] = []
    watcher = _watcher.get()
    with ThreadPoolExecutor(WORKERS) as pool:
        for i, result in enumerate(pool.map(work, range(count))):
            out.append(result)
            if done is not None:
                done(i + 1)
            if watcher is not None and what:
                watcher(what, i + 1, count)
    return out
