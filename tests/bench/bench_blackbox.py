"""Measures the closed-loop replay fit of black-box models on held-out flights."""

from __future__ import annotations

import statistics
import time

import numpy as np

from heli3dof.experiment.fly import fly_plan
from heli3dof.experiment.plan import load_plan
from heli3dof.identification.identify import identify
from heli3dof.recording.recording import Recording
from tests.bench import Figure, at_least

TITLE = "Black-box identification"
HIDE = (
    "motor.lag:0.1,stiffness.pendulum.roll:1.0,stiffness.pendulum.pitch:0.01,"
    "friction.viscous.roll:0.05,friction.viscous.pitch:0.01,friction.viscous.yaw:0.1"
)
SEEDS = (1, 2, 3, 4)
BARS = {"multisine": 85.0, "steps": 79.0, "large": 61.0}
"""%: required pitch fit, one point below the best black boxes before the project began"""
INTRO = f"""
Fit in closed-loop replay, 100 (1 − ‖y − ŷ‖/‖y − mean y‖), of `identify --method pem` (prediction
error; order and interval selected on the training flight) on a held-out flight of the same plan,
started level. The emulated rig hides `{HIDE}`. Means over seeds {", ".join(map(str, SEEDS))}; the
held-out flight has seed + 100. *True model*: the emulated rig itself without noise, an approximate
upper bound for every model.
"""


def flight(plan: str, seed: int, *, noise: float = 1.0) -> Recording:
    device = f"mock:?speed=max&start=level&hide={HIDE}&noise={noise:g}"
    flown = fly_plan(load_plan(plan), device=device, seed=seed)
    flown.raise_if_cut_short()
    return flown.recording


def fit_percent(measured: Recording, clean: Recording) -> np.ndarray:
    """Returns the (3,) fit in % of ``measured`` by ``clean``, over the rows in closed loop."""
    n = int(np.sum(measured.channels["phase"] == 0))
    y, z = measured.angle[:n], clean.angle[:n]
    error = np.linalg.norm(y - z, axis=0)
    return np.asarray(100 * (1 - error / np.linalg.norm(y - y.mean(axis=0), axis=0)))


def measure() -> list[Figure]:
    figures = []
    for plan, bar in BARS.items():
        fits, truths, seconds = [], [], []
        for seed in SEEDS:
            train, test = flight(plan, seed), flight(plan, seed + 100)
            truths.append(fit_percent(test, flight(plan, seed + 100, noise=0.0)))
            start = time.perf_counter()
            result = identify(train, holdout=test, method="pem")
            seconds.append(time.perf_counter() - start)
            fits.append(result.metrics.replay.fit_percent)
        mean, truth = np.mean(fits, axis=0), np.mean(truths, axis=0)
        each = ", ".join(f"{f[1]:.1f}" for f in fits)
        figures.append(
            at_least(
                f"pitch, replay of held-out `{plan}`", float(mean[1]), bar, "%",
                how=f"true model {truth[1]:.1f} %; by seed {each}; roll {mean[0]:.1f} % "
                f"(true model {truth[0]:.1f} %), yaw {mean[2]:.1f} % "
                f"(true model {truth[2]:.1f} %); a fit takes {statistics.median(seconds):.1f} s",
            )
        )  # fmt: skip
    return figures
