"""Processes and Dask clusters distribute work alike."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from heli3dof.batch.engines import SCHEDULER, engine
from heli3dof.batch.engines.base import Engine, Lost
from heli3dof.errors import DeviceError, UsageError
from tests.batch.small import dies_always, dies_once, fails, square, square_later


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """The address of a Dask cluster with two workers on this machine."""
    distributed = pytest.importorskip("distributed")
    import dask

    # A worker takes seconds to start again, so work is given up after its second worker.
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1}),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
        ) as running,
    ):
        yield running.scheduler_address


@pytest.fixture(params=["processes", "cluster"])
def either(request: pytest.FixtureRequest) -> Iterator[Engine]:
    address = request.getfixturevalue("cluster") if request.param == "cluster" else None
    with engine(address, None if address else 2) as used:
        yield used


def test_every_item_gets_its_result(either: Engine) -> None:
    assert dict(either.run(square, range(20))) == {n: n * n for n in range(20)}


def test_results_come_as_they_finish_with_the_number_of_their_item(either: Engine) -> None:
    assert sorted(either.run(square_later, range(6))) == [(n, n * n) for n in range(6)]


def test_there_may_be_nothing_to_do(either: Engine) -> None:
    assert list(either.run(square, [])) == []


def test_a_worker_that_ends_is_replaced_and_its_work_done_again(
    either: Engine, tmp_path: Path
) -> None:
    paths = [str(tmp_path / name) for name in "abc"]
    for path in paths[1:]:
        Path(path).touch()  # the first one only ends its worker
    assert dict(either.run(dies_once, paths)) == dict.fromkeys(range(3), "done")


def test_work_that_always_ends_its_worker_is_given_up_alone(either: Engine) -> None:
    results = dict(either.run(dies_always, range(5)))
    assert isinstance(results.pop(2), Lost)
    if not either.remote:  # Dask also counts the items that waited on a worker when it ended
        assert results == {n: n for n in (0, 1, 3, 4)}


def test_an_error_of_the_work_is_raised_here(either: Engine) -> None:
    with pytest.raises(ValueError, match="no such number"):
        list(either.run(fails, [1]))


def test_items_are_taken_as_workers_get_free(either: Engine) -> None:
    taken: list[int] = []
    running = either.run(square, (taken.append(n) or n for n in range(1000)))
    next(running)
    running.close()
    assert len(taken) <= 4 * either.workers


def test_a_cluster_out_of_reach_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("heli3dof.batch.engines.dask_cluster.ANSWER_S", 0.5)
    with pytest.raises(DeviceError, match="does not answer"), engine("tcp://127.0.0.1:9"):
        pass


def test_the_environment_variable_names_the_cluster(
    cluster: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(SCHEDULER, cluster)
    with engine() as used:
        assert used.remote
    with engine(workers=2) as used:
        assert not used.remote


def test_workers_with_other_code_are_refused(cluster: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("heli3dof.batch.engines.dask_cluster.code_version", lambda: "0.0.1+other")
    with pytest.raises(UsageError, match=r"here it is 0\.0\.1\+other"), engine(cluster):
        pass
