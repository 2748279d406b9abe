"""Simulated rig-terms without a change, and series with a step at a known flight."""

from __future__ import annotations

import numpy as np

from heli3dof.fleet.change_search import find_changes, track_prior

QUANTITIES = 10
TERMS = 100
SERIES = 100
FLIGHTS = 50


def false_alarms(flights: int, scatter: float, seed: int) -> int:
    """Return how many of `TERMS` rig-terms without a change have a report in any quantity.

    ``scatter``: standard deviation between flights; that of one flight is about 1.
    """
    rng = np.random.default_rng(seed)
    prior, t, reports = track_prior(QUANTITIES), np.arange(float(flights)), 0
    for _ in range(TERMS):
        found = []
        for _ in range(QUANTITIES):
            s = np.exp(rng.normal(0, 0.5, flights))
            found.append(find_changes(t, rng.normal(0, np.hypot(s, scatter)), s, prior))
        reports += any(found)
    return reports


def steps_found(size: float, seed: int) -> int:
    """Return how many of `SERIES` steps are found alone, with the date ± 1 flight.

    ``size``: in standard deviations of a flight; the step is after 5 to 45 of `FLIGHTS` flights.
    """
    rng = np.random.default_rng(seed)
    t, found = np.arange(float(FLIGHTS)), 0
    for _ in range(SERIES):
        k = int(rng.integers(5, FLIGHTS - 4))
        y = rng.normal(size=FLIGHTS) + size * (t >= k)
        changes = find_changes(t, y, np.ones(FLIGHTS), track_prior(20))
        steps = [c for c in changes if c.kind == "step"]
        found += len(steps) == 1 and abs(steps[0].first - k) <= 1
    return found
