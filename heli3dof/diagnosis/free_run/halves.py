"""Compare the estimates of a term in both halves of the flights (split-half consistency).

A fit's σ contains noise, but not errors of the model's form, which shift an estimate from one half
of the flights to the other. So each fold's training blocks (`free_run.refits`) are fitted alone.
θ_h ± σ_h is the estimate of a term's first parameter in half h. θ_0 is its null value, at which the
term has no effect.

    u_h = (θ_h − θ_0)/σ_h                      significant in both: min_h |u_h| ≥ `SIGNIFICANT`,
                                               all u_h of one sign, none mostly the prior
    δ = |θ_1 − θ_2| / √(σ_1² + σ_2²)           of one size: δ ≤ `CONSISTENT`

Both fits share the prior, which pulls both halves to one size; hence the last condition. If the
parameter varies by recording, χ² of its values is converted to a normal deviate u_h, and δ is 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.conclusion.single_recordings import CONSISTENT, SIGNIFICANT
from heli3dof.diagnosis.free_run.refits import recording_indices
from heli3dof.identification.greybox.multistep import MultiStepFit


@dataclass(frozen=True)
class HalvesComparison:
    """The estimates of one term in the halves of the flights."""

    u: tuple[float, ...]
    """u_h of each half"""
    discrepancy: float
    """δ of the first and the last half"""
    by_prior: bool
    """True if some estimate is mostly its prior"""

    @property
    def significant_in_both(self) -> bool:
        one_sign = len({math.copysign(1.0, u) for u in self.u}) == 1
        return one_sign and not self.by_prior and min(abs(u) for u in self.u) >= SIGNIFICANT

    @property
    def one_size(self) -> bool:
        return self.discrepancy <= CONSISTENT


def compare_halves(halves: tuple[MultiStepFit, ...], name: str) -> HalvesComparison | None:
    """Return the comparison for a term; None without two halves, or if the term has no σ."""
    values = [null_distance(h, name) for h in halves]
    if len(values) < 2 or any(v is None for v in values):
        return None
    known = [v for v in values if v is not None]
    u = tuple(x[0] for x in known)
    by_prior = any(x[3] for x in known)
    (_, a, s, _), (_, b, t, _) = known[0], known[-1]
    discrepancy = abs(a - b) / math.hypot(s, t) if s > 0 and t > 0 else 0.0
    return HalvesComparison(u, discrepancy, by_prior)


def null_distance(fit: MultiStepFit, name: str) -> tuple[float, float, float, bool] | None:
    """Return (u = (θ − θ_0)/σ, θ, σ, `mostly_prior`) of the term's first parameter.

    θ_0 is its value without the effect. On a logarithmic scale u = ∞, and θ, σ are of the scaled
    value. None without a parameter or σ.
    """
    p, mostly_prior = fit.problem, fit.mostly_prior
    for j, f in enumerate(fit.structure.free):
        if f.term != name:
            continue
        if f.log:
            std = float(np.sqrt(fit.scaled_covariance[j, j]))
            return math.inf, float(fit.z[j]), std, bool(mostly_prior[j])
        if f.name in p.varying:
            return equivalent_deviation(*chi_squared(fit, j)), 0.0, 0.0, False
        value, std = float(fit.values[j]), float(fit.std[j])
        if not std > 0:
            return None
        return (value - f.null) / std, value, std, bool(mostly_prior[j])
    return None


def chi_squared(fit: MultiStepFit, j: int) -> tuple[float, int]:
    """Return χ² of parameter j's values in n recordings about its null value, and n."""
    at, f = recording_indices(fit.problem, j), fit.structure.free[j]
    C = fit.scaled_covariance[np.ix_(at, at)]
    d = fit.z[at] - f.scaled(f.null)
    return float(d @ np.linalg.solve(C, d)), len(at)


def equivalent_deviation(chi2: float, freedom: int) -> float:
    """Return the standard normal deviate with the two-sided p-value of ``chi2``.

    ``freedom``: degrees of freedom of ``chi2``.
    """
    from scipy.stats import chi2 as law
    from scipy.stats import norm

    return float(norm.isf(max(law.sf(chi2, freedom), 1e-300) / 2))
