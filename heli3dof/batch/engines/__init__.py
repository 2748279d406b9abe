"""Engines distribute independent work: processes on this machine, or a Dask cluster."""

from __future__ import annotations

import os

from heli3dof.batch.engines.base import Engine, Lost

SCHEDULER = "DASK_SCHEDULER_ADDRESS"
"""Environment variable with the address of a Dask scheduler"""
__all__ = ["SCHEDULER", "Engine", "Lost", "engine"]


def engine(cluster: str | None = None, workers: int | None = None) -> Engine:
    """Return the engine: a Dask cluster if one is named, else processes on this machine.

    ``cluster``: the scheduler's address; if it and ``workers`` are None, the environment variable
    ``DASK_SCHEDULER_ADDRESS``. ``workers``: number of processes, by default one per core. Raises
    UsageError or DeviceError for a cluster out of reach.
    """
    address = cluster or (os.environ.get(SCHEDULER) if workers is None else None)
    if address:
        from heli3dof.batch.engines.dask_cluster import DaskCluster

        return DaskCluster(address)
    from heli3dof.batch.engines.processes import Processes

    return Processes(workers)
