"""Engines distribute independent work: processes on this machine, or a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import closing, contextmanager

from heli3dof.batch.engines.base import Engine, Lost

SCHEDULER = "DASK_SCHEDULER_ADDRESS"
"""Environment variable with the address of a Dask scheduler"""
__all__ = ["SCHEDULER", "Engine", "Lost", "engine"]


@contextmanager
def engine(cluster: str | None = None, workers: int | None = None) -> Iterator[Engine]:
    """Context manager: yield a Dask cluster, or ``workers`` processes on this machine.

    ``cluster`` is the address of the cluster's scheduler. If both arguments are None, the
    environment variable ``DASK_SCHEDULER_ADDRESS`` gives the address. Without an address, the
    engine uses processes: ``workers``, or if this is None, one per core. Raises UsageError or
    DeviceError if the cluster cannot be used.
    """
    address = cluster or (os.environ.get(SCHEDULER) if workers is None else None)
    if address:
        from heli3dof.batch.engines.dask_cluster import DaskCluster

        with closing(DaskCluster(address)) as dask:
            yield dask
        return
    from heli3dof.batch.engines.processes import Processes

    yield Processes(workers)
