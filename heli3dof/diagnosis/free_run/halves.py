"""Whether both halves of the flights show a cause: what only one of them shows is no name.

A fit's σ knows the noise, not what the model lacks; that moves a number from one half of the
flights to the other. So the blocks of each fold (`free_run.refits.halves`) are fitted
alone, and of a term's first number, with θ_h ± σ_h of half h and θ_0 its absence,

    u_h = (θ_h − θ_0)/σ_h           seen by both:  min_h |u_h| ≥ `SEEN`, all on one side
    δ = |θ_1 − θ_2| / √(σ_1² + σ_2²)            of one size:  δ ≤ `APART`

A number that differs by recording has as many values as there are recordings: u² is their χ²,
turned into as many deviations as are as rare. Both halves have the prior, which therefore pulls
both to one size: where it alone holds a number away from its absence (σ_h above `LITTLE` of the
prior's), that half has not seen it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.free_run.refits import own
from heli3dof.identification.greybox.multistep import MultiStepFit

SEEN = 1.645
"""95 % on one side, in each half"""
APART = 3.0
LITTLE = 0.7


@dataclass(frozen=True)
class Seen:
    """Of one term: how many deviations each half puts it from its absence, with the side."""

    u: tuple[float, ...]
    apart: float
    """δ, of the two halves that are furthest apart; 0 for what differs by recording"""
    by_prior: bool
    """Some half has it from the prior"""

    @property
    def by_both(self) -> bool:
        one_side = len({math.copysign(1.0, u) for u in self.u}) == 1
        return one_side and not self.by_prior and min(abs(u) for u in self.u) >= SEEN

    @property
    def one_size(self) -> bool:
        return self.apart <= APART


def seen(halves: tuple[MultiStepFit, ...], name: str) -> Seen | None:
    """None where there are no halves, or the term has no size (its absence is no number)."""
    values = [deviations(h, name) for h in halves]
    if len(values) < 2 or any(v is None for v in values):
        return None
    told = [v for v in values if v is not None]
    u = tuple(x[0] for x in told)
    by_prior = any(x[3] for x in told)
    (_, a, s, _), (_, b, t, _) = told[0], told[-1]
    apart = abs(a - b) / math.hypot(s, t) if s > 0 and t > 0 else 0.0
    return Seen(u, apart, by_prior)


def deviations(fit: MultiStepFit, name: str) -> tuple[float, float, float, bool] | None:
    """(u, θ, σ, whether the prior alone says so) of a term's first number in one fit.

    θ and σ are 0 for what differs by recording, and logarithms of what cannot be zero.
    """
    p = fit.problem
    for j, f in enumerate(fit.structure.free):
        if f.term != name:
            continue
        if f.log:  # its absence is infinitely far
            return math.inf, *_in_coordinates(fit, j)
        if f.name in p.varying:
            return rarity(*chi2_of(fit, j)), 0.0, 0.0, False
        value, std = float(fit.values[j]), float(fit.std[j])
        if not std > 0:
            return None
        return (value - f.null) / std, value, std, std > LITTLE * float(fit.prior_std[j])
    return None


def _in_coordinates(fit: MultiStepFit, j: int) -> tuple[float, float, bool]:
    p = fit.problem
    C, before = (np.linalg.inv(H)[j, j] for H in (fit.tangents @ fit.tangents.T + p.prior, p.prior))
    return float(fit.z[j]), float(np.sqrt(C)), bool(LITTLE**2 * before < C)


def chi2_of(fit: MultiStepFit, j: int) -> tuple[float, int]:
    """(χ², its freedom) of the recordings' own values of parameter j from its absence."""
    p = fit.problem
    at, f = own(p, j), fit.structure.free[j]
    C = np.linalg.inv(fit.tangents @ fit.tangents.T + p.prior)[np.ix_(at, at)]
    d = fit.z[at] - f.inward(f.null)
    return float(d @ np.linalg.solve(C, d)), len(at)


def rarity(chi2: float, freedom: int) -> float:
    """Deviations of a normal number that are as rare, two-sided, as that χ²."""
    from scipy.stats import chi2 as law
    from scipy.stats import norm

    return float(norm.isf(max(law.sf(chi2, freedom), 1e-300) / 2))
