"""Compares other identification tools on the same flights by the same scores (make bench-peers)."""

from __future__ import annotations

import contextlib
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.bench import Figure, Table, at_least
from tests.bench.peers import flights, judge
from tests.bench.peers.interface import Found, read_found
from tests.bench.peers.rigid_model import RigidModel
from tests.bench.peers.tools import (
    FILTER_ERROR,
    GREYBOX,
    OUTPUT_ERROR,
    TIME_LIMIT_S,
    TOOLS,
    VALIDATION,
    Tool,
    prepare_task,
    run,
)

TITLE = "Other tools on the same flights"
COMMAND = "make bench-peers"
PLANS = ("multisine", "steps")
SEEDS = (1, 2, 3, 4, 5)
SLOW_SEEDS = (1, 2)
"""Flights for tools whose fits take minutes"""
HELD_OUT = (VALIDATION, ("steps", 102))
WORKERS = max(1, (os.cpu_count() or 2) // 2)

INTRO = f"""The mock rig with masses, K_f and V_o 5 or 6 % off its profile, hiding
`{flights.HIDE}`, flown from level by the default controller at 500 Hz. Each fit has one flight
(70 s of `multisine` or 60 s of `steps`; seeds {SEEDS}, of the slow ones {SLOW_SEEDS}), and is
scored on two held-out flights (`multisine` seed 101, `steps` seed 102). Medians over the
seeds. CPU is that of the fit alone, one thread; memory the process's peak, libraries and all.
*Replay*: fit of the simulated closed loop, roll / pitch / yaw; one step: 40 ms ahead, the
lowest axis. *Rotor*: error of the pole at −1/τ. *Body*: RMS distance of the other five poles in
1/s. *Parameters*: median error of ten physical parameters, in units of K_f. *Coverage*: 95 %
intervals that contain the true value (of the parameters, else of the poles). The exact definition
of each column, and the setting of each tool with the page of its manual, are in
[tests/bench/peers](../tests/bench/peers). Black boxes get exact means of the voltage every 40 ms
(ours select 40 or 80 ms), AeroID every 20 ms. Physical fits start from the profile's numbers, or at
half or twice the true value where it has none. Two advantages for AeroID: its output error starts
at the true parameters, and its filter error gets the true noise. AeroID's fits take minutes and are
cached (bench-out/peers) until a flight or an adapter changes; the stated duration excludes them."""


@dataclass(frozen=True)
class Fit:
    """One fit with its scores; ``problem``: why there is no fit, else empty."""

    tool: Tool
    plan: str
    seed: int
    found: Found | None = None
    verdict: judge.Verdict | None = None
    problem: str = ""


def measure() -> list[Figure | Table]:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for plan in PLANS:
            for seed in SEEDS:
                prepare_task(plan, seed, folder)
        held_out = judge.flights([flights.fly(p, s, folder) for p, s in HELD_OUT])
        quiet = [flights.fly(p, s, folder, noise=0.0) for p, s in HELD_OUT]
        jobs = [
            (tool, plan, seed)
            for tool in TOOLS
            if not tool.missing()
            for seed in (SLOW_SEEDS if tool.slow else SEEDS)
            for plan in PLANS
        ]
        jobs.sort(key=lambda job: not job[0].slow)
        for tool in TOOLS:
            if tool.ours and not tool.missing():
                # Compiles if the cache is empty. A failure recurs below and is reported there.
                with contextlib.suppress(subprocess.SubprocessError):
                    run(tool, PLANS[0], SEEDS[0], folder)
        with ThreadPoolExecutor(WORKERS) as pool:
            fits = list(pool.map(lambda job: judged(*job, folder, held_out), jobs))
    truth_row = row_of_truth(judge.replay_of(quiet, held_out), held_out)
    tables = [table(plan, [f for f in fits if f.plan == plan], truth_row) for plan in PLANS]
    return [*tables, settings(fits), *claims(fits)]


def judged(tool: Tool, plan: str, seed: int, folder: Path, held_out: judge.Prepared) -> Fit:
    try:
        found = read_found(run(tool, plan, seed, folder))
    except subprocess.TimeoutExpired:
        return Fit(tool, plan, seed, problem=f"not done after {TIME_LIMIT_S} s")
    except subprocess.CalledProcessError as error:
        message = (error.stderr or "").strip().splitlines()
        return Fit(tool, plan, seed, problem=message[-1] if message else f"exit {error.returncode}")
    verdict = judge.judge(found, flights.truth(), flights.known(), held_out)
    replay = " / ".join(map(percent, verdict.replay))
    print(f"  {tool.name}, {plan} {seed}: {found.cpu_s:.3g} s, replay {replay} %", file=sys.stderr)
    return Fit(tool, plan, seed, found, verdict)


def table(plan: str, fits: Sequence[Fit], truth_row: Sequence[str]) -> Table:
    rows = [("true model, without noise", *truth_row)]
    for tool in TOOLS:
        mine = [f for f in fits if f.tool is tool]
        good = [f for f in mine if f.found is not None and f.verdict is not None]
        if good:
            rows.append((tool.name, *cells(good, len(mine))))
        else:
            why = tool.missing() or (mine[0].problem if mine else "")
            rows.append((tool.name, why, *[""] * (len(HEAD) - 2)))
    return Table(f"Fitted to `{plan}`", HEAD, tuple(rows))


HEAD = (
    "tool", "CPU s", "peak MB", "replay %", "one step %", "rotor %", "body 1/s", "parameters %",
    "coverage", "fits",
)  # fmt: skip


def cells(good: Sequence[Fit], of: int) -> tuple[str, ...]:
    verdicts = [f.verdict for f in good if f.verdict is not None]
    found = [f.found for f in good if f.found is not None]
    errors = np.concatenate([v.errors for v in verdicts])
    held = sum(v.covered[0] for v in verdicts)
    total = sum(v.covered[1] for v in verdicts)
    replay = np.median([v.replay for v in verdicts], axis=0)
    return (
        number(statistics.median(f.cpu_s for f in found)),
        number(statistics.median(f.peak_MB for f in found)),
        " / ".join(percent(x) for x in replay),
        percent(float(np.median([v.one_step for v in verdicts]))),
        number(middle([v.rotor_percent for v in verdicts])),
        number(middle([v.body_rad_s for v in verdicts])),
        number(100 * float(np.median(np.abs(errors)))) if len(errors) else "–",
        f"{held / total:.2f} of {total}" if total else "–",
        str(len(good)) if len(good) == of else f"{len(good)} of {of}",
    )


def row_of_truth(replay: np.ndarray, held_out: judge.Prepared) -> tuple[str, ...]:
    model = RigidModel(flights.truth(), flights.known())
    found = Found("physical", "", 0, 0, {"values": model.values, "stds": np.full(10, np.nan)})
    one_step = judge.judge(found, flights.truth(), flights.known(), held_out).one_step
    return ("", "", " / ".join(map(percent, replay)), percent(one_step), "0", "0", "0", "", "")


def settings(fits: Sequence[Fit]) -> Table:
    """Returns a table of each tool's settings on the first flight."""
    rows = []
    for tool in TOOLS:
        mine = [f.found.setting for f in fits if f.tool is tool and f.found is not None]
        rows.append((tool.name, mine[0] if mine else tool.missing() or "no fit succeeded"))
    return Table("Settings, on the first flight", ("tool", "setting"), tuple(rows))


def claims(fits: Sequence[Fit]) -> list[Figure]:
    """Returns the required advantages of the grey box over output error and filter error."""

    def errors(tool: Tool) -> np.ndarray:
        got = [
            f.verdict.errors
            for f in fits
            if f.tool is tool and f.verdict is not None and f.seed in SLOW_SEEDS
        ]
        return np.abs(np.concatenate(got)) if got else np.empty(0)

    def cpu_s(tool: Tool) -> float:
        return middle([f.found.cpu_s for f in fits if f.tool is tool and f.found is not None])

    what_oe = "median parameter error, output error's over the grey box's"
    what_fe = "CPU time, AeroID's filter error's over the grey box's"
    what_no_worse = "median parameter error, filter error's over the grey box's"
    grey, oe, fe = errors(GREYBOX), errors(OUTPUT_ERROR), errors(FILTER_ERROR)
    if not len(grey):
        why = GREYBOX.missing() or "the grey box has no fit"
        return [Figure(w, why, b) for w, b in (
            (what_oe, "≥ 4 ×"), (what_fe, "≥ 50 ×"), (what_no_worse, "≥ 1 ×"))]  # fmt: skip
    how = f"seeds {SLOW_SEEDS} of {' and '.join(PLANS)}, ten parameters each"
    base = float(np.median(grey))
    figures = []
    if len(oe):
        figures.append(at_least(what_oe, float(np.median(oe)) / base, 4, "×", how=how))
    if len(fe):
        figures += [
            at_least(what_fe, cpu_s(FILTER_ERROR) / cpu_s(GREYBOX), 50, "×", how="medians"),
            at_least(what_no_worse, float(np.median(fe)) / base, 1, "×", how=how),
        ]
    return figures


def middle(values: Sequence[float]) -> float:
    """Returns the median of the finite values; NaN if there are none."""
    good = [v for v in values if np.isfinite(v)]
    return statistics.median(good) if good else np.nan


def number(value: float) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def percent(value: float) -> str:
    """Returns a fit in % as text: "diverges" for −100 or less."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.1f}" if value > -100 else "diverges"
