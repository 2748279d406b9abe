"""Distribute the Monte Carlo replications of one diagnosis to an engine, such as a Dask cluster.

With n workers, the replications are divided into n parts: part k = 0 … n − 1 holds the replications
k, k + n, k + 2n, … The function that computes a replication contains the recordings, about 0.3 MB
per second of flight. So this function is sent only once per part.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

from heli3dof.batch.engines import Engine, Lost, engine
from heli3dof.parallel import Distributor, distribute
from heli3dof.results import optional


@contextmanager
def replications_on_cluster(address: str | None) -> Iterator[None]:
    """Context manager: a diagnosis inside it computes its replications on a Dask cluster.

    ``address`` is that of the cluster's scheduler; if it is None, this computer computes the
    replications. Raises DeviceError or UsageError if the cluster cannot be used.
    """
    if address is None:
        yield
        return
    with engine(address) as cluster, distribute(replications_on(cluster)):
        yield


def replications_on(cluster: Engine) -> Distributor:
    """Return a function with which `heli3dof.parallel.distribute` sends replications to an engine.

    ``cluster``: the engine, such as a Dask cluster. If several workers exit while they compute one
    part of the replications, this process computes that part.
    """

    def distributor(work: Callable[[int], Any], count: int) -> Iterator[tuple[int, Any]]:
        cloudpickle: Any = optional("cloudpickle", extra="cluster")
        n = min(count, cluster.workers)
        parts = [range(k, count, n) for k in range(n)]
        for k, results in cluster.run(partial(_part, cloudpickle.dumps(work)), parts):
            if isinstance(results, Lost):
                results = [work(i) for i in parts[k]]
            yield from zip(parts[k], results, strict=True)

    return distributor


def _part(pickled_work: bytes, part: range) -> list[Any]:
    work = pickle.loads(pickled_work)
    return [work(i) for i in part]
