"""`DaskCluster`: distributes work to a Dask distributed cluster.

If a worker ends, Dask gives its work to another one. If the scheduler is restarted, this engine
connects again and resends the items without a result. The workers must run the same code as this
process.
"""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable, Generator, Iterable
from itertools import islice
from typing import TYPE_CHECKING, Any

from heli3dof.batch.engines.base import AHEAD, Lost, R, T
from heli3dof.batch.task import code_version
from heli3dof.errors import DeviceError, UsageError
from heli3dof.parallel import limit_threads
from heli3dof.results import optional

if TYPE_CHECKING:
    from distributed import Client

ANSWER_S = 10
"""Time limit in s for the scheduler's first answer, and for its first worker. Chosen."""
RESTART_S = 60
"""Time limit in s for a scheduler to return after its connection broke. Chosen."""
MEMORY = "memory"
"""Name of the Dask resource that states a worker's memory in bytes, as in
``dask worker ADDRESS --resources memory=8e9``"""
WARNS_FROM = {"distributed.admin.large-graph-warning-threshold": "4 GiB"}
"""Dask's threshold for a warning on large items. Its default is 10 MB; recordings may be larger."""
RESERVED = 1e9
"""Bytes of `MEMORY` that each item reserves, if a worker states how much memory it has. Chosen: a
whole diagnosis of a minute of flight needs 0.3 GB, so there is room for longer flights."""


class DaskCluster:
    """Engine that uses the workers of a Dask cluster; ``address``: its scheduler's address."""

    remote = True

    def __init__(self, address: str) -> None:
        self._address = address
        optional("distributed", extra="cluster")
        self._client = self._connected()
        self._await_worker(ANSWER_S)
        self._check_code()

    def close(self) -> None:
        self._client.close()

    @property
    def workers(self) -> int:
        return _threads(self._workers())

    def run(self, work: Callable[[T], R], items: Iterable[T]) -> Generator[tuple[int, R | Lost]]:
        import dask
        from distributed import KilledWorker, as_completed
        from distributed.client import FutureCancelledError

        waiting = enumerate(items)
        running: dict[str, tuple[int, T]] = {}
        arrived = as_completed(loop=self._client.loop, raise_errors=False)

        def send(each: Iterable[tuple[int, T]], workers: dict[str, Any]) -> None:
            states_memory = any(MEMORY in w["resources"] for w in workers.values())
            for n, item in each:
                reserved = {MEMORY: RESERVED} if states_memory else None
                with dask.config.set(WARNS_FROM):
                    future = self._client.submit(
                        _in_worker, work, item, code_version(), retries=0, pure=False,
                        key=f"heli3dof-{uuid.uuid4().hex}", resources=reserved,
                    )  # fmt: skip
                running[future.key] = n, item
                arrived.add(future)

        def send_more() -> None:
            workers = self._workers()
            room = max(0, (1 + AHEAD) * _threads(workers) - len(running))
            send(islice(waiting, room), workers)

        try:
            send_more()
            while running:
                future = next(arrived)
                if future.key not in running:
                    continue
                n, item = running.pop(future.key)
                if future.status == "finished":
                    yield n, future.result()
                elif future.status == "error" and isinstance(future.exception(), KilledWorker):
                    yield n, Lost("several workers of the cluster ended while they did it")
                elif future.status == "error" and not isinstance(
                    future.exception(), FutureCancelledError
                ):
                    raise future.exception()
                else:  # the scheduler lost it
                    lost = [(n, item), *running.values()]
                    running.clear()
                    self._reconnect()
                    arrived = as_completed(loop=self._client.loop, raise_errors=False)
                    send(lost, self._workers())
                future.release()
                send_more()
        finally:
            for future in list(arrived.futures):
                future.cancel()

    def _connected(self) -> Client:
        from distributed import Client

        try:
            return Client(self._address, timeout=ANSWER_S, set_as_default=False)
        except (OSError, TimeoutError, ValueError) as error:
            raise DeviceError(
                f"The Dask scheduler {self._address} does not answer: {error}.",
                cause="it is not running, or the address is another one.",
                fix="dask scheduler, on its machine, prints the address; --cluster ADDRESS",
            ) from None

    def _reconnect(self) -> None:
        """Connect again to a scheduler that was restarted, and wait for its first worker."""
        self._client.close(timeout=1)
        until = time.monotonic() + RESTART_S
        while True:
            try:
                self._client = self._connected()
                break
            except DeviceError:
                if time.monotonic() > until:
                    raise
                time.sleep(1)
        self._await_worker(RESTART_S)
        self._check_code()

    def _workers(self) -> dict[str, Any]:
        return dict(self._client.scheduler_info(n_workers=-1)["workers"])

    def _await_worker(self, timeout_s: float) -> None:
        """Wait for the first worker. Raises DeviceError if there is none after ``timeout_s``."""
        try:
            self._client.wait_for_workers(1, timeout=timeout_s)
        except TimeoutError:
            raise DeviceError(
                f"The Dask scheduler {self._address} has no worker after {timeout_s:g} s.",
                cause="no worker was started, or none has found the scheduler yet.",
                fix=f"dask worker {self._address} --nthreads 1",
            ) from None

    def _check_code(self) -> None:
        """Raise UsageError if a worker runs another version of heli3dof's code."""
        mine = code_version()
        for worker, other in self._client.run(_version_of_worker).items():
            if other != mine:
                raise other_code(worker, other)


def _threads(workers: dict[str, Any]) -> int:
    return max(1, sum(int(w["nthreads"]) for w in workers.values()))


def other_code(worker: str, other: str) -> UsageError:
    """Return the error for the ``worker`` (address) that runs the version ``other`` of heli3dof."""
    return UsageError(
        f"The worker {worker} runs heli3dof {other}; here it is {code_version()}.",
        cause="another version is installed there, or a file was changed here.",
        fix="install the same version of heli3dof on every worker, and restart the workers",
    )


def _version_of_worker() -> str:
    return code_version()


def _in_worker(work: Callable[[T], R], item: T, version: str) -> R:
    """Return ``work(item)``, computed with one thread in this worker.

    Raises UsageError unless this worker runs the ``version`` of the process that sent the work.
    """
    if code_version() != version:  # a worker that joined later
        from distributed import get_worker

        raise other_code(get_worker().address, code_version())
    limit_threads(1)
    return work(item)
