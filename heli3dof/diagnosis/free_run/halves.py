"""Compare the estimates of a term in both halves of the flights (split-half consistency).

A fit's σ contains noise, but not errors of the model's form, which shift an estimate from one half
of the flights to the other. So each fold's training blocks (`free_run.refits`) are fitted alone.
θ_h ± σ_h is the estimate of a term's first parameter in half h. θ_0 is its null value, at which the
term has no effect.

    u_h = (θ_h − θ_0)/σ_h                      significant in both: min_h |u_h| ≥ `SIGNIFICANT`,
                                               all u_h of one sign, none mostly the prior
    δ = |θ_1 − θ_2| / √(σ_1² + σ_2²)           of one size: δ ≤ `SIGMAS_99`

Both fits share the prior, which pulls both halves to one size; hence the last condition. If the
parameter varies by recording, χ² of its values is converted to a normal deviate u_h, and δ is 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from heli3dof.diagnosis.conclusion.single_recordings import SIGNIFICANT, of_one_size
from heli3dof.diagnosis.free_run.refits import recording_indices
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.model.physics.parametrisation import first_parameters


class NullDistance(NamedTuple):
    """Distance of a term's first parameter θ from its value θ_0 without the effect."""

    u: float
    """(θ − θ_0)/σ; ∞ on a logarithmic scale"""
    value: float
    std: float
    """θ and σ; of the scaled value on a logarithmic scale, 0 for one that varies by recording"""
    mostly_prior: bool = False


def compare_halves(halves: Sequence[MultiStepFit], name: str) -> tuple[bool, bool] | None:
    """Return whether a term has (one size, a significant size) in both ``halves``.

    None without two halves, or if the term has no σ.
    """
    known = [d for h in halves if (d := null_distance(h, name)) is not None]
    return compared(*known) if len(known) == 2 else None


def compared(a: NullDistance, b: NullDistance) -> tuple[bool, bool]:
    """Return whether the estimates of both halves agree, and whether both are significant."""
    one_sign = math.copysign(1.0, a.u) == math.copysign(1.0, b.u)
    significant = one_sign and not (a.mostly_prior or b.mostly_prior)
    significant = significant and min(abs(a.u), abs(b.u)) >= SIGNIFICANT
    return of_one_size((a.value, a.std), (b.value, b.std)), significant


def null_distance(fit: MultiStepFit, name: str) -> NullDistance | None:
    """Return the distance of a term's first parameter; None without a parameter or σ."""
    j = first_parameters(fit.structure.free).get(name)
    if j is None:
        return None
    f, mostly_prior = fit.structure.free[j], bool(fit.mostly_prior[j])
    if f.log:
        std = float(np.sqrt(fit.scaled_covariance[j, j]))
        return NullDistance(math.inf, float(fit.z[j]), std, mostly_prior)
    if f.name in fit.problem.varying:
        return NullDistance(equivalent_deviation(*chi_squared(fit, j)), 0.0, 0.0)
    value, std = float(fit.values[j]), float(fit.std[j])
    return NullDistance((value - f.null) / std, value, std, mostly_prior) if std > 0 else None


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
