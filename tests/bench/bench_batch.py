"""Measures the overhead of `heli3dof batch`, and its speed on two Dask workers.

Environment variables:

- BATCH_FLIGHTS: number of flights (default 40)
- BATCH_ROUNDS: repetitions of the comparison with the Python functions (default 5)

Flights are kept in bench-out/batch, so a second run does not fly them again. Ratios compare
measurements that alternate in one run, so that other work on the computer affects both alike.
"""

from __future__ import annotations

import os
import pickle
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import numpy as np

from heli3dof.batch.engines import engine
from heli3dof.batch.engines.base import Engine
from heli3dof.batch.engines.dask_cluster import DaskCluster
from heli3dof.batch.engines.processes import Processes
from heli3dof.batch.engines.replications import replications_on
from heli3dof.batch.output_folder import OutputFolder, journal_lines
from heli3dof.batch.run_batch import Batch, run_batch, tasks_of
from heli3dof.batch.sources import find
from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.diagnosis.document import diagnosis_document
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.identify import identify
from heli3dof.integrity import integrity
from heli3dof.parallel import distribute
from heli3dof.recording.load import load
from tests.bench import Figure, at_least, at_most
from tests.paths import ROOT

TITLE = "Many recordings"
INTRO = """Flights of the emulated rig on the plan `rich` (about a minute at 500 Hz) with hidden
friction and lag. *Overhead*: `batch identify` with one process against `load`, `identify` and
`integrity` in a loop; the start of the process does not count. *Scaling*: quick diagnoses by two
Dask workers on this computer against one, one thread each. *One diagnosis on a cluster*: its null
simulations go to the workers, the fits remain here."""
FLIGHTS = int(os.environ.get("BATCH_FLIGHTS", "40"))
ROUNDS = int(os.environ.get("BATCH_ROUNDS", "5"))
FOLDER = ROOT / "bench-out" / "batch"
IDENTIFIED = 10
"""Recordings of one round of the overhead; more only lengthen it"""
HALVES = 2
"""Parts of the diagnoses, so that one and two workers alternate: 1, 2, then 2, 1"""
QUICK = {"quick": True, "seed": 0, "replicate": 0}
"""Options of `batch diagnose --quick`"""


def measure() -> list[Figure]:
    paths = flown(FLIGHTS)
    return [*overhead(paths[:IDENTIFIED]), *scaling(paths)]


def flown(count: int) -> list[str]:
    """Fly what has not been flown; returns the paths of the recordings."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    with engine() as used:
        for n, _ in enumerate(used.run(fly, range(count)), 1):
            print(f"  flown {n}/{count}", end="\r", file=sys.stderr)
    return [str(path_of(seed)) for seed in range(count)]


def path_of(seed: int) -> Path:
    return FOLDER / f"flight-{seed:03d}.mcap"


def fly(seed: int) -> None:
    if path_of(seed).exists():
        return
    rng = np.random.default_rng([20_261_125, seed])
    friction, lag = rng.uniform(0.05, 0.2), rng.uniform(0.02, 0.08)
    hidden = f"friction.viscous.yaw:{friction:.4f},motor.lag:{lag:.4f}"
    device = f"mock:?speed=max&seed={seed}&spread=0.05&hide={hidden}"
    fly_plan(load_plan("rich"), device=device, output=path_of(seed)).raise_if_cut_short()


@dataclass
class Arrivals:
    """When the outcomes of a batch were kept, and the CPU time of this process until then."""

    hashes_s: float
    """s of CPU time per recording for the hashes of the files"""
    seconds: list[float] = field(default_factory=list)
    cpu_s: list[float] = field(default_factory=list)

    def __call__(self, batch: Batch) -> None:
        if batch.done:
            self.seconds.append(time.perf_counter())
            self.cpu_s.append(time.process_time())

    @property
    def each_s(self) -> float:
        """s per recording, without the first one, which waits for the process to start."""
        return (self.seconds[-1] - self.seconds[0]) / (len(self.seconds) - 1)

    @property
    def own_s(self) -> float:
        """s of CPU time of this process per recording, without the start."""
        return self.hashes_s + (self.cpu_s[-1] - self.cpu_s[0]) / (len(self.cpu_s) - 1)


@contextmanager
def batch(
    verb: str, options: Mapping[str, Any], paths: Sequence[str], used: Engine
) -> Iterator[tuple[Path, Arrivals]]:
    """Run a batch; yields its folder, which is deleted afterwards, and the times of arrival."""
    before = time.process_time()
    tasks = list(tasks_of(verb, find(paths), [options], None, ""))
    arrivals = Arrivals((time.process_time() - before) / len(paths))
    with tempfile.TemporaryDirectory(dir=FOLDER) as name:
        with OutputFolder(Path(name), resume=True) as folder:
            done = run_batch(tasks, folder, used, arrivals)
        assert not done.failed, f"{verb}: {done.failed} of {done.total} failed"
        yield Path(name), arrivals


def overhead(paths: Sequence[str]) -> list[Figure]:
    """Figures of `batch identify` against the functions that it calls; their rounds alternate.

    Both leave out the first recording of a round.
    """
    checks: list[float] = []

    def functions() -> tuple[float, float]:
        """s per recording: elapsed, and of CPU time."""
        start = np.zeros(2)
        for n, path in enumerate(paths):
            if n == 1:
                start = np.array([time.perf_counter(), time.process_time()])
            recording = load(Path(path))
            identify(recording)
            before = time.perf_counter()
            integrity(recording)
            checks.append((time.perf_counter() - before) * bool(n))
        wall, cpu = np.array([time.perf_counter(), time.process_time()]) - start
        return wall / (len(paths) - 1), cpu / (len(paths) - 1)

    def verb() -> tuple[float, float]:
        with batch("identify", {}, paths, Processes(1)) as (folder, arrivals):
            costs = [line["cost"]["cpu_s"] for line in journal_lines(folder)]
            return arrivals.each_s, sum(costs[1:]) / (len(costs) - 1) + arrivals.own_s

    functions()  # compiles
    checks.clear()
    pairs = []
    for n in range(ROUNDS):
        one, other = (functions, verb) if n % 2 else (verb, functions)
        first, second = one(), other()
        pairs.append((second, first) if n % 2 else (first, second))
        print(f"  overhead, round {n + 1}: {pairs[-1]}", file=sys.stderr)
    with_batch, without = np.array(pairs).transpose(1, 0, 2)
    ratios = 100 * (with_batch / without - 1)  # (round, elapsed and CPU)
    check_s = sum(checks) / (ROUNDS * (len(paths) - 1))
    return [
        at_most(
            "`batch identify`: overhead per recording", float(np.median(ratios[:, 0])), 5, "%",
            how=f"median of {ROUNDS} rounds of {len(paths)} recordings, "
            f"{ratios[:, 0].min():.1f} to {ratios[:, 0].max():.1f} %; without it "
            f"{np.median(without[:, 0]):.2f} s each, of which the integrity check takes "
            f"{check_s:.2f} s",
        ),
        Figure(
            "`batch identify`: overhead per recording in CPU time",
            f"{np.median(ratios[:, 1]):.3g} %",
            how=f"both processes of `batch`; without it {np.median(without[:, 1]):.2f} s",
        ),
    ]  # fmt: skip


def scaling(paths: Sequence[str]) -> list[Figure]:
    """Figure of two Dask workers against one; the two alternate."""
    try:
        import distributed
    except ModuleNotFoundError:
        print("  scaling: distributed is not installed", file=sys.stderr)
        return []
    seconds, cpu_s = {1: 0.0, 2: 0.0}, {1: 0.0, 2: 0.0}
    with ExitStack() as stack:
        clusters = {}
        for workers in seconds:
            local = stack.enter_context(
                distributed.LocalCluster(
                    n_workers=workers, threads_per_worker=1, dashboard_address=":0"
                )
            )
            clusters[workers] = stack.enter_context(DaskCluster(local.scheduler_address))
            with batch("diagnose", QUICK, paths[:workers], clusters[workers]):
                pass  # compiles
        for n, half in enumerate(np.array_split(np.array(paths), HALVES)):
            for workers in sorted(seconds, reverse=bool(n % 2)):
                start = time.perf_counter()
                with batch("diagnose", QUICK, half.tolist(), clusters[workers]) as (folder, _):
                    seconds[workers] += time.perf_counter() - start
                    cpu_s[workers] += sum(x["cost"]["cpu_s"] for x in journal_lines(folder))
                print(f"  diagnosed, {workers} workers: {seconds}", file=sys.stderr)
        here = on_a_cluster(paths[0], clusters[2])
    return [
        here,
        at_least(
            "two Dask workers against one: diagnoses per hour", seconds[1] / seconds[2], 1.8, "x",
            how=f"{len(paths)} quick diagnoses, one thread each: {seconds[1]:.0f} and "
            f"{seconds[2]:.0f} s; CPU time of one: {cpu_s[1] / len(paths):.1f} and "
            f"{cpu_s[2] / len(paths):.1f} s",
        )
    ]  # fmt: skip


def on_a_cluster(path: str, cluster: Engine) -> Figure:
    """Figure of what remains on this computer of one diagnosis on a cluster, in CPU time."""
    sent: list[int] = []

    class Counted:
        """The cluster; notes the bytes that it is sent."""

        workers = cluster.workers

        def run(self, work: Any, items: Sequence[Any]) -> Any:
            sent.append(len(items) * len(pickle.dumps(work)))
            return cluster.run(work, items)

    def diagnosed() -> tuple[Any, float]:
        start = time.process_time()
        document = diagnosis_document(diagnose(load(Path(path))))
        document["about"].pop("seconds")
        return document, time.process_time() - start

    diagnosed()  # compiles
    alone, all_s = diagnosed()
    with distribute(replications_on(cast(Engine, Counted()))):
        shared, here_s = diagnosed()
    assert shared == alone, "the cluster gives other numbers"
    return Figure(
        "one diagnosis on a cluster: CPU time that remains here",
        f"{100 * here_s / all_s:.0f} %",
        how=f"{here_s:.1f} of {all_s:.1f} s, so it is at most {all_s / here_s:.1f} times as fast; "
        f"same numbers; {sum(sent) / 1e6:.0f} MB sent to {cluster.workers} workers",
    )
