"""A Dask scheduler that is restarted in the middle of a batch."""

from __future__ import annotations

import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from heli3dof.batch.engines import engine
from heli3dof.batch.output_folder import OutputFolder
from heli3dof.batch.results_table import CSV, PARQUET, read_rows
from heli3dof.batch.run_batch import Batch, run_batch, tasks_of
from heli3dof.batch.sources import find
from heli3dof.errors import DeviceError
from tests.batch.small import write_small
from tests.batch.test_run_batch import InProcess

ENDS_IN_S = 10


class Cluster:
    """A scheduler and a worker as processes of this computer, always at the same address."""

    def __init__(self, processes: ExitStack) -> None:
        self._processes = processes
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self._port = free.getsockname()[1]
        self.address = f"tcp://127.0.0.1:{self._port}"
        self.start()

    def start(self) -> None:
        where = ("--host", "127.0.0.1", "--port", str(self._port), "--no-dashboard")
        self._scheduler = self._run("scheduler", *where)
        self._run("worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard")

    def restart(self) -> None:
        self._scheduler.kill()
        self._scheduler.wait()
        self.start()

    def _run(self, kind: str, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *words]
        silent = subprocess.DEVNULL
        process = subprocess.Popen(command, stdout=silent, stderr=silent)
        self._processes.callback(process.wait, ENDS_IN_S)
        self._processes.callback(process.kill)
        return process


@pytest.fixture
def cluster() -> Iterator[Cluster]:
    pytest.importorskip("distributed")
    with ExitStack() as processes:
        yield Cluster(processes)


def test_a_batch_survives_a_restart_of_the_scheduler(
    cluster: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every recording has its row, and the tables are the same bytes as without a cluster."""
    monkeypatch.setattr("heli3dof.batch.engines.dask_cluster.ANSWER_S", 60)
    term = tmp_path / "term"
    term.mkdir()
    for n in range(12):
        write_small(term / f"flight-{n:02d}.mcap", roll_deg=5.0 + n)
    restarts = []

    def restart_once(batch: Batch) -> None:
        if batch.done == 2 and not restarts:
            restarts.append(batch.done)
            cluster.restart()

    tasks = list(tasks_of("info", find([str(term)]), [{}], None, ""))
    with engine(cluster.address) as used, OutputFolder(tmp_path / "out", resume=False) as folder:
        done = run_batch(tasks, folder, used, restart_once)
    assert restarts == [2]
    assert (done.done, done.failed) == (12, 0)
    with OutputFolder(tmp_path / "here", resume=False) as folder:
        run_batch(tasks, folder, InProcess())
    for name in (CSV, PARQUET):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "here" / name).read_bytes()
    names = [row["name"] for row in read_rows(tmp_path / "out")]
    assert names == [f"flight-{n:02d}" for n in range(12)]


def test_a_scheduler_without_a_worker_is_an_error_with_the_command_that_starts_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("heli3dof.batch.engines.dask_cluster.ANSWER_S", 1)
    from distributed import LocalCluster

    with LocalCluster(n_workers=0, dashboard_address=None, host="127.0.0.1") as cluster:
        with (
            pytest.raises(DeviceError, match="has no worker after 1 s") as error,
            engine(cluster.scheduler_address),
        ):
            pass
        assert error.value.fix == f"dask worker {cluster.scheduler_address} --nthreads 1"
