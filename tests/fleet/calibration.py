"""Simulated rig-terms without a change, and series with a step at a known flight.

Seeds: below 100 in the tests, 100 to 199 on the page (the final numbers), 1000 and above in
development. The thresholds were fixed before the seeds of the page were drawn.
"""

from __future__ import annotations

import numpy as np

from heli3dof.fleet.change_search import find_changes, track_prior
from heli3dof.fleet.tracks import Track
from heli3dof.fleet.variance_prior import variance_prior

QUANTITIES = 10
TERMS = 100
SERIES = 100
FLIGHTS = 50
RIGS = 20


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


def track_of(y: np.ndarray) -> Track:
    """A track with these values, s = 1, one plan and one flight a day."""
    n = len(y)
    names = tuple(f"flight-{i:02d}" for i in range(n))
    one, rich, found = np.ones(n), np.full(n, "rich"), np.zeros(n, bool)
    return Track("r", "q", np.arange(float(n)), y, one, rich, names, found, True)


def room(
    rng: np.random.Generator, flights: int, *, scatter: float = 1.0, spread: float = 0.0,
    odd: float = 1.0, rigs: int = RIGS,
) -> list[Track]:  # fmt: skip
    """The tracks of a quantity that did not change.

    ``scatter``: median standard deviation of a flight; ``spread``: standard deviation of its
    logarithm over the rigs; ``odd``: further factor of the first rig.
    """
    std = scatter * np.exp(spread * rng.normal(size=rigs))
    std[0] *= odd
    return [track_of(each * rng.normal(size=flights)) for each in std]


def false_alarms_in_rooms(flights: int, spread: float, odd: float, seed: int) -> int:
    """Return how many of `TERMS` rig-terms in rooms of `RIGS` have a report in any quantity."""
    rng, prior = np.random.default_rng(seed), track_prior(QUANTITIES)
    reported: set[tuple[int, int]] = set()
    for term in range(TERMS // RIGS):
        for _ in range(QUANTITIES):
            tracks = room(rng, flights, spread=spread, odd=odd)
            for rig, one in enumerate(tracks):
                scale = variance_prior([t for t in tracks if t is not one])
                if find_changes(one.t, one.y, one.s, prior, one.plans, scale):
                    reported.add((term, rig))
    return len(reported)


def false_alarms_correlated(flights: int, correlation: float, seed: int) -> int:
    """Return how many of `SERIES` first-order autoregressive series without a change have a report.

    ``correlation``: of successive flights.
    """
    rng, t, reports = np.random.default_rng(seed), np.arange(float(flights)), 0
    for _ in range(SERIES):
        y = rng.normal(size=flights)
        for i in range(1, flights):
            y[i] = correlation * y[i - 1] + np.sqrt(1 - correlation**2) * y[i]
        reports += bool(find_changes(t, y, np.ones(flights), track_prior(QUANTITIES)))
    return reports


def steps_found(size: float, seed: int, *, flights: int = FLIGHTS, siblings: int = 0) -> int:
    """Return how many of `SERIES` steps are found alone, with the date ± 1 flight.

    ``size``: in standard deviations of a flight. At least 5 flights of 50, and in proportion of
    fewer, but at least 2, are on each side. ``siblings``: rigs with as many flights.
    """
    rng = np.random.default_rng(seed)
    t, found, least = np.arange(float(flights)), 0, max(2, flights // 10)
    for _ in range(SERIES):
        k = int(rng.integers(least, flights - least + 1))
        y = rng.normal(size=flights) + size * (t >= k)
        scale = variance_prior(room(rng, flights, rigs=siblings)) if siblings else None
        changes = find_changes(t, y, np.ones(flights), track_prior(20), None, scale)
        steps = [c for c in changes if c.kind == "step"]
        found += len(steps) == 1 and abs(steps[0].first - k) <= 1
    return found
