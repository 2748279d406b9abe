"""`Processes`: distributes work to processes on this machine.

pebble's pool replaces a process that dies, for example because the memory is full. Each process
uses an equal share of the cores.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import Counter
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import FIRST_COMPLETED, Future, wait

from pebble import ProcessExpired, ProcessPool

from heli3dof.batch.engines.base import AHEAD, Lost, R, T
from heli3dof.parallel import core_count, limit_threads

MOST_DEATHS = 3
"""If this many processes end while they work on the same item, it is `Lost` (Dask's default)."""
PRELOADED = [
    "heli3dof.batch.run_task",
    "heli3dof.diagnosis.diagnose",
    "heli3dof.identification.identify",
]
"""Modules that are imported once for all processes, because the import takes over a second"""
THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")


class Processes:
    """Engine that uses ``workers`` processes on this machine, by default one per core."""

    remote = False

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or core_count()

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Generator[tuple[int, R | Lost]]:
        threads = max(1, core_count() // self.workers)
        waiting = enumerate(items)
        deaths: Counter[int] = Counter()
        running: dict[Future[R], tuple[int, T]] = {}
        pool = ProcessPool(
            self.workers, context=_context(), initializer=_begin, initargs=(threads,)
        )
        try:
            while True:
                while len(running) < (1 + AHEAD) * self.workers:
                    following = next(waiting, None)
                    if following is None:
                        break
                    running[pool.schedule(work, [following[1]])] = following
                if not running:
                    break
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    n, item = running.pop(future)
                    try:
                        yield n, future.result()
                    except ProcessExpired as error:
                        deaths[n] += 1
                        if deaths[n] < MOST_DEATHS:
                            running[pool.schedule(work, [item])] = (n, item)
                        else:
                            yield n, Lost(f"the process that worked on it ended ({_status(error)})")
            pool.close()  # type: ignore[no-untyped-call]
        finally:
            pool.stop()  # type: ignore[no-untyped-call]
            pool.join()


def _context() -> multiprocessing.context.BaseContext:
    """Return the `multiprocessing` context that starts the worker processes.

    It is a fork server that has imported `PRELOADED`, or "spawn" on systems without fork servers.
    """
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOADED)
    return context


def _begin(threads: int) -> None:
    """Prepare a worker: limit it to ``threads`` threads; leave Ctrl-C to the parent process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in THREADS:
        os.environ[name] = str(threads)
    limit_threads(threads)


def _status(error: ProcessExpired) -> str:
    code = error.exitcode
    if code is not None and code < 0:
        name = signal.Signals(-code).name
        return f"{name}; the memory was probably full" if name == "SIGKILL" else name
    return f"status {code}"
