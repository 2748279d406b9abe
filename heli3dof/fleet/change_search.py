"""Changes of one quantity of one rig: steps, drifts, deviating flights.

The search finds the most probable change in all flights (`change_posterior`). A step divides the
flights into two parts, two steps into three; the search continues in each part. A deviating flight
is removed, and the search starts again. Several deviating flights would hide each other. So a
Hampel filter first proposes candidates, and each is tested without the other candidates. At the
end, the date, size and probability of each step are computed from the flights between its two
neighbouring steps.

A change is reported if its posterior probability is at least p = `REPORTED` = 0.95. A rig is
expected to change 0.15 times per semester (`CHANGES_PER_RIG_SEMESTER`). Divided by the number of
quantities, this is the prior probability π of a change in one quantity. If the posterior is
calibrated, at most (1 − p)/p reports are false for each true one. A quantity that did not change
then gets a false report with a probability of at most π·(1 − p)/p. For all quantities of a rig
together, this is 0.15 · 0.05/0.95 = 0.8 % per semester.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.fleet.change_posterior import (
    LEAST_SIDE,
    SINGLE,
    ChangePosterior,
    Prior,
    VariancePrior,
    change_posterior,
)
from heli3dof.fleet.variance_prior import MAD_TO_STD

REPORTED = 0.95
"""Least probability of a reported change: at most one report in 20 is false (a convention)"""
CHANGES_PER_RIG_SEMESTER = {
    "step": 1 / 40, "two_steps": 1 / 40, "drift": 1 / 20, "deviating": 1 / 20
}  # fmt: skip
"""Expected changes of a rig in a semester, in all its quantities. Chosen: a room of twenty rigs
has one step, one drift and one deviating flight a semester. Half of the steps come in pairs: a
fault and its repair."""
LEAST_FLIGHTS = 8
"""Flights that a search needs: the least number for which the calibration is tested"""
DATES = 0.95
"""Probability that the stated dates of a step contain the true one (a convention)"""
MOST_DEVIATING = 0.2
"""Largest share of deviating flights: with more, the others would be no reference. Chosen."""
HAMPEL_WIDTH = 5
"""Number of flights in the running median of the Hampel filter (a convention). With 5, the filter
does not propose two flights after a step at the end of the series as deviating."""
HAMPEL_SIGMAS = 5.0
"""Standard deviations from the running median above which the Hampel filter proposes a flight as
deviating. Chosen; the posterior decides."""
REFINEMENTS = 5
"""Largest number of passes over all steps, per step. Chosen: the second pass changes few dates."""
NORMAL_95 = 1.96
"""Half width of a 95 % interval in standard deviations"""


@dataclass(frozen=True, eq=False)
class Change:
    """A change of a quantity; flights are indices in the arrays of all flights searched."""

    kind: str
    """``step``, ``drift`` or ``deviating``"""
    first: int
    """Step: first flight after it. Drift: its first flight. Deviating: the flight"""
    last: int
    """Step: last flight before it. Drift: its last flight. Deviating: the flight"""
    probability: float
    """Posterior probability that the quantity changed at all in the flights searched"""
    kinds: Mapping[str, float]
    """Probability of each kind; they sum to ``probability``"""
    dates: Mapping[int, float]
    """For a step: first flight after it → probability; the likeliest flights, together 95 %"""
    size: float
    """Size of the change in the quantity's unit; of a drift, from its first to its last flight"""
    interval: tuple[float, float]
    """95 % limits of ``size``"""


def track_prior(quantities: int) -> Prior:
    """Return the prior probability of each kind of change in one quantity of a rig.

    ``quantities``: the number of the rig's quantities. They share the expected number of changes of
    a rig, `CHANGES_PER_RIG_SEMESTER`, equally.
    """
    return _scaled(CHANGES_PER_RIG_SEMESTER, 1 / quantities)


def _scaled(prior: Prior, factor: float) -> Prior:
    return {kind: factor * probability for kind, probability in prior.items()}


def find_changes(
    t: FloatArray, y: FloatArray, s: FloatArray | None, prior: Prior,
    plans: np.ndarray | None = None, variance_prior: VariancePrior | None = None,
    hidden: FloatArray | None = None,
) -> tuple[Change, ...]:  # fmt: skip
    """Return the changes in n flights: steps and drifts in order of time, then deviating flights.

    ``t``, ``y``, ``s`` (n,): increasing times, values, standard deviations. If ``s`` is None, the
    values need not be normally distributed, so the search uses their normal scores. ``plans`` (n,):
    the flight plan of each flight; None: all have the same plan. ``variance_prior``: prior of the
    variance from flight to flight, estimated from the fleet's other rigs. ``hidden`` (n,): hᵢ in
    `change_posterior`; None: 0.
    """
    hidden = np.zeros_like(y) if hidden is None else hidden
    plans = np.zeros(len(y), int) if plans is None else plans
    series = _Series(t, y, s, prior, plans, variance_prior, hidden)
    deviating = list(_clear_outliers(series))
    kept = np.setdiff1d(np.arange(len(y)), [c.first for c in deviating])
    while True:
        found = list(_search(series, kept))
        outside = [c for c in found if c.kind == "deviating"]
        if not outside or len(deviating) + 1 > MOST_DEVIATING * len(y):
            break
        worst = max(outside, key=lambda c: c.probability)
        deviating.append(worst)
        kept = kept[kept != worst.first]
    steps = _refined(series, kept, [c for c in found if c.kind == "step"])
    drifts = [c for c in found if c.kind == "drift"]
    in_order = sorted([*steps, *drifts], key=lambda c: c.first)
    return (*in_order, *sorted(deviating, key=lambda c: c.first))


@dataclass(frozen=True, eq=False)
class _Series:
    t: FloatArray
    y: FloatArray
    s: FloatArray | None
    prior: Prior
    plans: np.ndarray
    variance_prior: VariancePrior | None
    hidden: FloatArray

    def is_searchable(self, flights: np.ndarray) -> bool:
        """Return True if ``flights`` are enough to search them for changes.

        At least `LEAST_FLIGHTS` are needed, and one more for each flight plan after the first.
        """
        return len(flights) - len(np.unique(self.plans[flights])) >= LEAST_FLIGHTS - 1

    def posterior(self, flights: np.ndarray) -> ChangePosterior:
        """Return the posterior probabilities of the changes in a part of the series.

        ``flights``: the indices of this part's flights. The prior probability of a change is known
        for the whole series. The function multiplies it by the share of these flights in the
        series.
        """
        t, y, plans = self.t[flights], self.y[flights], self.plans[flights]
        prior = _scaled(self.prior, len(flights) / len(self.y))
        if self.s is not None:
            s, hidden = self.s[flights], self.hidden[flights]
            return change_posterior(y, s, t, prior, plans, self.variance_prior, hidden)
        equal = np.ones(len(y))
        by_rank = change_posterior(normal_scores(y), equal, t, prior, plans)
        sized = change_posterior(y, equal, t, prior, plans)
        return replace(by_rank, size=sized.size, size_std=sized.size_std)


def normal_scores(y: FloatArray) -> FloatArray:
    """Return the normal quantiles of the ranks of ``y`` (n,), Φ⁻¹((rank − ½)/n), without unit."""
    from scipy.special import ndtri
    from scipy.stats import rankdata

    scores: FloatArray = ndtri((rankdata(y) - 0.5) / len(y))
    return scores


def _clear_outliers(series: _Series) -> Iterator[Change]:
    """Yield the deviating flights that a Hampel filter proposes and the posterior confirms."""
    from scipy.ndimage import median_filter

    n = len(series.y)
    if series.s is None or not series.is_searchable(np.arange(n)):
        return
    y = series.y.copy()
    for plan in np.unique(series.plans):
        y[series.plans == plan] -= np.median(y[series.plans == plan])
    off = np.abs(y - median_filter(y, size=HAMPEL_WIDTH, mode="mirror"))
    order = np.argsort(-off)[: int(MOST_DEVIATING * n)]
    proposed = order[off[order] > HAMPEL_SIGMAS * MAD_TO_STD * np.median(off)]
    others = np.setdiff1d(np.arange(n), proposed)
    for flight in proposed:
        flights = np.sort(np.append(others, flight))
        change = _most_probable_change(series, flights)
        if change is not None and (change.kind, change.first) == ("deviating", flight):
            yield change


def _search(series: _Series, flights: np.ndarray) -> Iterator[Change]:
    """Yield the changes in ``flights``, found by recursive search.

    If the function finds one or two steps, they divide the flights into two or three parts. The
    function then searches each part. A drift or a deviating flight does not divide the flights.
    """
    if not series.is_searchable(flights):
        return
    posterior = series.posterior(flights)
    if 1 - posterior.constant < REPORTED:
        return
    kind = posterior.most_probable
    if kind in ("drift", "deviating"):
        yield _change(posterior, flights, kind)
        return
    start = 0
    for end in posterior.candidates[kind][posterior.best(kind)]:
        yield from _search(series, flights[start:end])
        yield _change(posterior, flights, "step", end)
        start = end
    yield from _search(series, flights[start:])


def _most_probable_change(series: _Series, flights: np.ndarray) -> Change | None:
    """Return the most probable change in ``flights``, or None.

    It is None if the probability that anything changed in these flights is below `REPORTED`.
    """
    posterior = series.posterior(flights)
    if 1 - posterior.constant < REPORTED:
        return None
    return _change(posterior, flights, max(SINGLE, key=posterior.kind))


def _refined(series: _Series, kept: np.ndarray, steps: list[Change]) -> list[Change]:
    """Return ``steps`` with improved dates and sizes, without the steps that are not confirmed.

    The function makes several passes over the steps. Each pass has these stages:

    1. Compute the date, size and probabilities of each step again, from the flights between the
       previous and the next step.
    2. If the date of any step has changed, begin the next pass.
    3. Find the steps that are not confirmed. A step is confirmed if two conditions hold: in its
       flights, the probability of a change of any kind is at least `REPORTED`, and the probability
       of a step is at least 50 %.
    4. If all steps are confirmed, end. Otherwise remove one step that is not confirmed: the one
       with the smallest probability of a step. Then begin the next pass.

    The number of passes is at most `REFINEMENTS` times the number of ``steps``. ``kept``: the
    indices of all flights except the deviating ones (single outliers).
    """
    for _ in range(REFINEMENTS * len(steps)):
        before = [c.first for c in steps]
        for i in range(len(steps)):
            start = steps[i - 1].first if i else 0
            end = steps[i + 1].first if i + 1 < len(steps) else len(series.y)
            window = kept[(kept >= start) & (kept < end)]
            steps[i] = _change(series.posterior(window), window, "step")
        if [c.first for c in steps] != before:
            continue
        weak = [c for c in steps if c.probability < REPORTED or c.kinds[c.kind] < 0.5]
        if not weak:
            break
        steps.remove(min(weak, key=lambda c: c.kinds[c.kind]))
    return steps


def _change(
    posterior: ChangePosterior, flights: np.ndarray, kind: str, before: int | None = None
) -> Change:
    """Return the most probable change of this ``kind`` in ``flights``.

    ``before`` selects the step before this flight (an index in ``flights``); None selects the most
    probable step.
    """
    model = posterior.best(kind)
    size, std = posterior.size[kind], posterior.size_std[kind]
    value, variance = float(size[model]), float(std[model]) ** 2
    first, last = posterior.candidates[kind][model][0], len(flights) - 1
    dates: dict[int, float] = {}
    if kind == "deviating":
        last = first
    if kind == "step":
        first = first if before is None else before
        last = first - 1
        share = posterior.probability[kind] + np.finfo(float).tiny  # 0 where all values are equal
        share /= share.sum()
        dates = _dates(share, flights)
        value = float(share @ size)
        variance = float(share @ (std**2 + (size - value) ** 2))
    kinds = {k: posterior.kind(k) for k in SINGLE}
    kinds["step"] += posterior.kind("two_steps")
    half = NORMAL_95 * sqrt(variance)
    return Change(
        kind, int(flights[first]), int(flights[last]), 1 - posterior.constant,
        kinds, dates, value, (value - half, value + half),
    )  # fmt: skip


def _dates(share: FloatArray, flights: np.ndarray) -> dict[int, float]:
    """Return a credible set of the flights that may be the first after a step, by index.

    It is {flight: probability}: the fewest flights whose probabilities add up to at least `DATES`.
    ``share[i]``: the probability that ``flights[i + 2]`` is the first flight after the step.
    """
    order = np.argsort(-share, kind="stable")
    many = int(np.searchsorted(np.cumsum(share[order]), DATES)) + 1
    return {int(flights[i + LEAST_SIDE]): float(share[i]) for i in sorted(order[:many])}
