"""Measures the diagnosis of flights with hidden effects: ``make bench-hidden``; see `tests.hidden`.

Environment variables:

- HIDDEN_FIRST: first seed (default 0, for the final tables; use 1000 and above in development)
- HIDDEN_SHARE: share of the cases of each class (default 1)
- HIDDEN_JOBS: number of processes (default: one per core, or the workers of the Dask cluster that
  DASK_SCHEDULER_ADDRESS names)

Cases whose results are stored are not run again.
"""

from __future__ import annotations

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from heli3dof.batch.engines import SCHEDULER
from tests.bench import Figure, Table
from tests.hidden import outside
from tests.hidden.cases import CLASSES, blind, draw, fly
from tests.hidden.run import run, wanted
from tests.hidden.tally import (
    LEAST_STATEMENTS,
    Judged,
    confusions,
    judged,
    largest_deviation,
    median_error,
    rates,
    summary,
    times_s,
)
from tests.hidden.tools import TOOLS

TITLE = "Hidden effects"
COMMAND = "make bench-hidden"
FIRST = int(os.environ.get("HIDDEN_FIRST", "0"))
SHARE = float(os.environ.get("HIDDEN_SHARE", "1"))
JOBS = int(os.environ.get("HIDDEN_JOBS", "0")) or None
AT_ONCE = JOBS or ("as many as workers" if SCHEDULER in os.environ else os.cpu_count())
TIMED = ("rich-nothing", "rich-medium", "rich-pair")
TIMED_SEEDS = (1001, 1002)
CORES = 2

INTRO = f"""Flights of the emulated rig with its own parameters drawn within ± 7 % of the
profile's, on the plan `rich`, on `steps` and on what `heli3dof run-step --roll 10` flies; each
class's cases are seeds {FIRST} and up. The hidden effects and their sizes are in
[sizes.py](../tests/hidden/sizes.py); effects that no recording can distinguish, stated beforehand,
in [equivalences.py](../tests/hidden/equivalences.py); the criteria of a right answer in
[judge.py](../tests/hidden/judge.py). The diagnosis gets a recording and a profile, without the
device's URL. A finding on the wrong axis is wrong. *Wrong names*: share of
all names reported without a confounded alternative. Brackets: 95 % interval of a share (Wilson).
PySINDy's recipe is in
[pysindy_discrepancy.py](../tests/bench/peers/pysindy_discrepancy.py), with the adaptations
made in its favour. Indistinguishable columns count as confounded. It has no columns for timing,
mass changes or torques of unknown frequency. The residual test reports no names."""


def measure() -> list[Figure | Table]:
    jobs = wanted(FIRST, SHARE)
    by_tool: dict[str, list[Judged]] = {}
    for name in ("whole", "pysindy", "residuals"):
        if TOOLS[name].missing:
            print(f"  {TOOLS[name].title}: {TOOLS[name].missing}", file=sys.stderr)
            continue
        lines = list(run(jobs, name, processes=JOBS).values())
        by_tool[name] = judged(lines)
        if name == "whole":
            print(summary(lines))
    ours = by_tool["whole"]
    return [
        Table("Hidden effect and reported effect (with counts where several)", HEAD,
              tuple(rows(ours))),
        comparison(by_tool), *figures(ours),
        *outside.figures([j for j in ours if j.group.endswith("-outside")], processes=JOBS),
        *reliability_figures(ours), *timed(),
    ]  # fmt: skip


HEAD = ("hidden", "flights", "right", "found")


def rows(cases: list[Judged]) -> list[tuple[str, ...]]:
    """Returns the confusion matrix as rows (hidden effect, group, right/all, reported causes)."""
    return [
        (hidden, group, f"{right}/{n}", result)
        for hidden, group, n, right, result in confusions(cases)
    ]


def comparison(asked: dict[str, list[Judged]]) -> Table:
    """Returns a table with one row per rate and one column per tool."""
    by_tool = {name: {r.what: r for r in rates(cases)} for name, cases in asked.items()}
    whats = list(by_tool["whole"])
    table = [
        (what, *(f"{r[what].text} [{r[what].between}]" if what in r else "–"
                 for r in by_tool.values()))
        for what in whats
    ]  # fmt: skip
    error = [median_error(cases) for cases in asked.values()]
    table.append(("parameter error of the named cause, median",
                  *("–" if np.isnan(e) else f"{100 * e:.1f} %" for e in error)))  # fmt: skip
    seconds = [times_s(cases) for cases in asked.values()]
    table.append((f"s for one flight, {AT_ONCE} at once: median",
                  *(f"{middle:.1f}" for middle, _ in seconds)))  # fmt: skip
    table.append(("s for one flight: 95 % quantile", *(f"{slow:.1f}" for _, slow in seconds)))
    head = ("", *(TOOLS[name].title for name in asked))
    return Table("The same flights, other tools", head, tuple(table))


def figures(cases: list[Judged]) -> list[Figure]:
    """Returns the rates with a required value, and the median parameter error."""
    out = [r.figure for r in rates(cases) if r.bar is not None]
    error = median_error(cases)
    out.append(
        Figure("parameter error of the named cause, median",
               "–" if np.isnan(error) else f"{100 * error:.1f} %", "≤ 5 %",
               None if np.isnan(error) else error <= 0.05,
               "relative to the distance of the true value from no effect")
    )  # fmt: skip
    return out


def reliability_figures(cases: list[Judged]) -> list[Figure]:
    """Returns how far stated confidences are from the share of right statements."""
    deviation, statements = largest_deviation(cases)
    if np.isnan(deviation):
        return []
    return [
        Figure("confidence of named causes: largest deviation from the share of right ones",
               f"{deviation:.2f}", "≤ 0.05", deviation <= 0.05,
               f"{statements} statements in bins of 0.1, of which bins with {LEAST_STATEMENTS} and "
               "more count; right: hidden, or confounded with it")
    ]  # fmt: skip


def timed() -> list[Figure]:
    """Returns run times for one minute at 500 Hz on two otherwise idle cores, after compilation."""
    out = []
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=_two_cores) as pool:
        for tool, bar_s in (("quick", 10.0), ("whole", 40.0)):
            seconds = pool.submit(_seconds, tool).result()
            slowest = max(seconds)
            out.append(
                Figure(
                    f"{TOOLS[tool].title}, 60 s at 500 Hz, {CORES} cores: slowest",
                    f"{slowest:.1f} s", f"≤ {bar_s:g} s", slowest <= bar_s,
                    f"{len(seconds)} flights, median {sorted(seconds)[len(seconds) // 2]:.1f} s",
                )
            )  # fmt: skip
    return out


def _two_cores() -> None:
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, set(sorted(os.sched_getaffinity(0))[:CORES]))


def _seconds(tool: str) -> list[float]:
    out = []
    cases = [draw(group, seed) for group in TIMED for seed in TIMED_SEEDS]
    for case in (cases[0], *cases):
        recording = blind(fly(case).recording)
        start = time.perf_counter()
        TOOLS[tool].ask(recording)
        out.append(time.perf_counter() - start)
    return out[1:]


assert set(TIMED) <= set(CLASSES)
