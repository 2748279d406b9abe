"""How good the identified models are on flights that no fit has seen, and how long a fit takes."""

from __future__ import annotations

import time

import numpy as np

from heli3dof.identification import identify
from heli3dof.identification.pem import pem
from heli3dof.identification.prepare import prepare
from heli3dof.identification.search import decimated, starts
from tests.bench import Figure, at_least, at_most
from tests.identification.mock_flights import PLANS, mock_flight, truth_replay
from tests.paths import REAL_DATA

TITLE = "Black-box identification"
INTRO = """
Flights of the emulated rig with a rotor lag of 0.1 s, pendula on roll and pitch and viscous
friction (`tests/identification/mock_flights.py`). Fitted on seeds 1–3, tested on seeds 11–13 of
the same plan; order and interval chosen from the fitted flights alone. *Replay* is the loop flown
on the model through the same references, from 5 s after lift-off; the *truth* is the emulated rig
itself flown without its noise. No linear model can reach the truth on large flights.
"""
BARS = {"multisine": 85.0, "steps": 79.0, "large": 61.0}
SEEDS = (1, 2, 3)


def measure() -> list[Figure]:
    figures = []
    for plan in PLANS:
        for method in ("pem", "pbsid", "oe"):
            figures += _replay(plan, method)
    figures += _speed()
    figures += _real()
    return figures


def _replay(plan: str, method: str) -> list[Figure]:
    fits, ahead, truths, orders = [], [], [], []
    for seed in SEEDS:
        found = identify(
            mock_flight(plan, seed), holdout=mock_flight(plan, seed + 10), method=method
        )
        fits.append(found.metrics.replay.fit_percent)
        ahead.append([found.metrics.prediction[h].fit_percent for h in (0.0, 0.1, 0.5, 1.0)])
        orders.append(found.order)
        start = found.prepared.held_out[0].start + 1000
        truths.append(truth_replay(plan, seed + 10, start))
    fit, truth = np.mean(fits, axis=0), np.mean(truths, axis=0)
    low, high = np.min(fits, axis=0)[1], np.max(fits, axis=0)[1]
    how = f"{low:.1f} … {high:.1f}; truth {truth[1]:.1f}; orders {', '.join(map(str, orders))}"
    what = f"`{plan}`, {method}: replay, pitch"
    if method != "pem":
        return [Figure(what, f"{fit[1]:.4g} %", how=how)]
    mean = np.mean(ahead, axis=0)
    steps = " / ".join(f"{v:.1f}" for v in mean[:, 1])
    return [
        at_least(what, float(fit[1]), BARS[plan], "%", how=how),
        Figure(f"`{plan}`, pem: replay, roll and yaw", f"{fit[0]:.1f} and {fit[2]:.1f} %"),
        Figure(f"`{plan}`, pem: pitch one step / 0.1 / 0.5 / 1 s ahead", f"{steps} %"),
    ]


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


def _real() -> list[Figure]:
    if not REAL_DATA.is_dir():
        return []
    from heli3dof.recording.load import load
    from heli3dof.rig.profile import load_profile

    figures = []
    for rig, train, test in (
        ("rig-a", ("1a", "2a"), "1b"),
        ("rig-b", ("03", "05", "08", "09"), "13"),
    ):
        profile = load_profile(REAL_DATA / rig / "profile.toml")
        names = (*train, test)
        *fit, held = (load(REAL_DATA / rig / f"closed-{n}.csv", profile) for n in names)
        found = identify(fit, holdout=held)
        for h in (0.1, 0.5, 1.0, 3.0):
            rmse = np.rad2deg(found.metrics.prediction[h].rmse)
            fits = found.metrics.prediction[h].fit_percent
            figures.append(
                Figure(
                    f"real {rig}, closed-{test}: {h:g} s ahead, RMSE roll / pitch / yaw",
                    " / ".join(f"{v:.2f}" for v in rmse) + "°",
                    how="fit " + " / ".join(f"{v:.0f}" for v in fits) + f" %; order {found.order}",
                )
            )
    return figures
