"""Measures the speed of the emulated rig, and the replay fit of the true model."""

from __future__ import annotations

import statistics
import time

import numpy as np

from heli3dof.experiment.plan import load_plan
from heli3dof.rig.drivers import open_driver
from heli3dof.rig.interface import Command
from heli3dof.rig.profile import default_profile
from tests.bench import Figure, at_least
from tests.drivers.flying import fit_percent, fly

TITLE = "The mock rig"
INTRO = (
    "Speed: exchanges through the port at `speed=max`, 500 Hz, one thread, without controller and "
    "recorder. Replay: 100 (1 − ‖y − ŷ‖/‖y − mean y‖) of the same plant without noise through the "
    "same plan (seed 1, from level), an approximate upper bound for every model."
)
SECONDS = 40.0
SEEDS = (1, 2, 3)


def times_real_time(hide: str) -> float:
    profile = default_profile()
    rig = open_driver(f"mock:?speed=max&start=level&hide={hide}", profile)
    rig.arm()
    n = round(SECONDS / profile.dt)
    start = time.perf_counter()
    for k in range(n):
        rig.exchange(Command(k + 1, 7.456, 7.456), 0.0)
    return SECONDS / (time.perf_counter() - start)


def measure() -> list[Figure]:
    figures = []
    for what, hide in (
        ("nothing hidden", ""),
        ("three effects hidden", "friction.coulomb.yaw:0.03,motor.lag:0.1,motor.dead_zone:1"),
    ):
        speeds = [times_real_time(hide) for _ in range(5)]
        how = f"median of 5 × {SECONDS:g} s, {min(speeds):.0f} to {max(speeds):.0f}"
        figures.append(
            at_least(f"mock, {what}", statistics.median(speeds), 200, "× real time", how=how)
        )
    return figures + [true_model_replays(plan) for plan in ("multisine", "steps", "large")]


def true_model_replays(plan: str) -> Figure:
    profile = default_profile()
    signals = load_plan(plan).render(profile.dt, 1)
    device = "mock:?speed=max&start=level"
    clean = fly(f"{device}&noise=0", signals.reference, signals.extra)
    fits = np.array(
        [
            fit_percent(
                fly(f"{device}&seed={s}", signals.reference, signals.extra).angle, clean.true
            )
            for s in SEEDS
        ]
    )
    roll, pitch, yaw = fits.mean(axis=0)
    return Figure(
        f"true model replayed, plan `{plan}`: roll / pitch / yaw",
        f"{roll:.1f} / {pitch:.1f} / {yaw:.1f} %",
        how=f"mean of seeds {SEEDS}; pitch {fits[:, 1].min():.1f} to {fits[:, 1].max():.1f}",
    )
