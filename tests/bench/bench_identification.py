"""Measures the estimators: prediction and replay errors on held-out flights, time of a fit."""

from __future__ import annotations

import time

import numpy as np

from heli3dof.identification.black_box.order_selection import decimated, starts
from heli3dof.identification.black_box.pem import pem
from heli3dof.identification.identify import identify
from heli3dof.identification.preprocessing import prepare
from tests.bench import Figure, at_most
from tests.identification.mock_flights import PLANS, mock_flight, truth_replay

TITLE = "Identification: methods compared"
INTRO = """
Flights of the emulated rig with a rotor lag of 0.1 s, pendula on roll and pitch and viscous
friction (`tests/identification/mock_flights.py`). Fitted on seeds 1–3, tested on seeds 11–13 of the
same plan; order and interval selected on the training flights. *Replay* simulates the closed loop
of the model with the same references, from 5 s after lift-off. *True model*: the emulated rig
itself without noise. All methods predict well one step ahead; 1 s ahead and in closed loop they
differ.
"""
SEEDS = (1, 2, 3)


def measure() -> list[Figure]:
    figures = []
    for plan in PLANS:
        for method in ("pem", "pbsid", "oe", "tf4"):
            figures.append(_replay(plan, method))
    figures += _speed()
    return figures


def _replay(plan: str, method: str) -> Figure:
    fits, ahead, truths, orders = [], [], [], []
    for seed in SEEDS:
        result = identify(
            mock_flight(plan, seed), holdout=mock_flight(plan, seed + 10), method=method
        )
        fits.append(result.metrics.replay.fit_percent)
        ahead.append([result.metrics.prediction[h].fit_percent for h in (0.0, 0.1, 0.5, 1.0)])
        orders.append(result.order)
        start = result.prepared.held_out[0].start + 1000
        truths.append(truth_replay(plan, seed + 10, start))
    fit, truth = np.array(fits)[:, 1], np.mean(truths, axis=0)[1]
    each = ", ".join("diverges" if f < -1e3 else f"{f:.1f}" for f in fit)
    steps = " / ".join(f"{v:.1f}" for v in np.mean(ahead, axis=0)[:, 1])
    return Figure(
        f"`{plan}`, {method}: pitch one step / 0.1 / 0.5 / 1 s ahead",
        f"{steps} %",
        how=f"replay by seed {each} (true model {truth:.1f}); orders {', '.join(map(str, orders))}",
    )


def _speed() -> list[Figure]:
    prepared = prepare([mock_flight("multisine", 1)])
    d = decimated(prepared, prepared.train, 0.04)
    seconds = sum(len(u) for u, _ in d.data) * d.interval_s
    start = starts(d, [8])[8]
    pem(d.data, start)
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        pem(d.data, start)
        times.append(time.perf_counter() - begin)
    return [
        at_most(
            "one prediction-error fit of order 8, with its covariance", min(times), 2.0, "s",
            how=f"{seconds:.0f} s of flight every 40 ms, best of 5",
        )
    ]  # fmt: skip
