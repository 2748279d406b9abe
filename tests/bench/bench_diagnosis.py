"""Measures run times of a diagnosis on two cores: no hidden effect and one, quick and full."""

from __future__ import annotations

import contextlib
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from heli3dof.diagnosis.diagnose import diagnose
from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import Plan, load_plan, step_plan
from heli3dof.recording.recording import Recording
from tests.bench import Figure, Table, at_most

TITLE = "Run time of a diagnosis"
SEED = 1003
CORES = 2
CAUSE = "friction.coulomb.yaw:0.03"
PLANS = ("rich", "steps", "run-step")
BARS = {True: 5.0, False: 12.0}
LONG_S = 600.0
INTRO = (
    f"Flights of the mock rig at 500 Hz with parameters off by up to 7 % (seed {SEED}), with "
    f"nothing hidden and with `{CAUSE}`; the process may use {CORES} cores. "
    "Warm: `diagnose` in a process that has run a diagnosis before. Cold: the command "
    "`heli3dof diagnose`, from start to exit, with compiled code in the cache. CPU: time of all "
    "threads; a longer wall-clock time means that the cores were busy with other work."
)
HELI3DOF = str(Path(sys.executable).parent / "heli3dof")


def plan_of(name: str) -> Plan:
    if name == "run-step":
        return step_plan((10.0, None, None), settle_s=10.0, duration_s=20.0)
    return load_plan(name)


def flight(name: str, hide: str, path: Path | None = None) -> Recording:
    device = f"mock:?speed=max&spread=0.07&hide={hide}"
    return fly_plan(plan_of(name), device=device, seed=SEED, output=path).recording


@contextlib.contextmanager
def cores(count: int) -> Iterator[None]:
    """Restrict this process and its children to ``count`` cores, if the system supports it."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, set(sorted(before)[:count]))
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def warm(recording: Recording, quick: bool) -> tuple[float, float, str]:
    """Diagnose in this process; returns wall time (s), CPU time (s) and verdict."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = diagnose(recording, quick=quick)
    return time.perf_counter() - wall, time.process_time() - cpu, result.verdict


def cold(path: Path, quick: bool) -> float:
    """Returns the time in s of the command ``heli3dof diagnose``, from start to exit."""
    model = path.with_suffix(".model.json")
    words = [HELI3DOF, "diagnose", str(path), "-o", str(model), "--force", "--json"]
    start = time.perf_counter()
    done = subprocess.run(words + ["--quick"] * quick, check=True, capture_output=True)
    took = time.perf_counter() - start
    json.loads(done.stdout)
    return took


def measure() -> list[Figure | Table]:
    figures: list[Figure | Table] = []
    rows = []
    with cores(CORES), tempfile.TemporaryDirectory() as folder:
        diagnose(flight("run-step", CAUSE), quick=True)  # compiles
        for name in PLANS:
            for hide in ("", CAUSE):
                path = Path(folder) / f"{name}{len(rows)}.mcap"
                recording = flight(name, hide, path)
                for quick in (True, False):
                    wall, cpu, verdict = warm(recording, quick)
                    whole = cold(path, quick)
                    rows.append(
                        (
                            name, "quick" if quick else "whole", hide or "nothing",
                            f"{wall:.1f}", f"{cpu:.1f}", f"{whole:.1f}", verdict.replace("_", " "),
                        )
                    )  # fmt: skip
                    if name == "rich":
                        mode = "quick" if quick else "whole"
                        figures.append(
                            at_most(
                                f"`diagnose` of 60 s at 500 Hz, {mode}, {hide or 'nothing hidden'}",
                                wall, BARS[quick], "s",
                                how=f"one run, warm; {cpu:.1f} s of CPU",
                            )
                        )  # fmt: skip
        figures += long_flight(Path(folder))
    head = ("plan", "", "hidden", "warm, s", "CPU, s", "cold, s", "verdict")
    return [*figures, Table("Seconds on two cores", head, tuple(rows))]


def long_flight(folder: Path) -> list[Figure]:
    """Time and peak memory of ``diagnose --quick`` on ten minutes of the plan rich, repeated."""
    rich = load_plan("rich")
    plan = replace(rich, segments=rich.segments * math.ceil(LONG_S / rich.duration_s))
    path = folder / "long.mcap"
    device = f"mock:?speed=max&spread=0.07&hide={CAUSE}"
    recording = fly_plan(plan, device=device, seed=SEED, output=path).recording
    seconds = cold(path, quick=True)
    peak_GB = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024 / 1e9
    how = f"cold; {recording.duration:.0f} s at 500 Hz, `{CAUSE}` hidden"
    return [
        at_most("`diagnose --quick` of ten minutes", seconds, 60.0, "s", how=how),
        at_most("`diagnose --quick` of ten minutes, peak memory", peak_GB, 1.0, "GB", how=how),
    ]
