"""Decide which terms of the fitted model are causes, and which are only kept in the model.

A term is an effect on one axis, such as dry friction on pitch. Let θ̂ be the estimate of its first
parameter, σ its standard error, and θ_0 the parameter's null value, at which the term has no
effect. The confidence level (two-sided) at which the parameter differs from θ_0 is

    P = erf(|θ̂ − θ_0| / (σ √2))

A parameter may have a separate value in each of R recordings. Let d (R,) be the distances of these
values from θ_0, with the covariance matrix C. The confidence level is then

    P = Pr(χ²_R < χ̂²),        χ̂² = dᵀ C⁻¹ d

A term is a cause if all of these hold:

- A model without the term predicts held-out blocks worse. This condition is waived for a term known
  beforehand, that is, if the prior already excludes θ_0 (`free_run.elimination`).
- P ≥ `LEVEL`, and the recordings determine the estimate more than the prior does: σ is clearly
  below the prior's standard deviation (`MultiStepFit.mostly_prior`).
- The estimates from the two halves of the data agree, and both are significant (see below). A term
  known beforehand need not be significant.

All other terms stay in the model, because the rig may have such an effect although the recordings
do not show it. Their priors keep the estimated sizes realistic. If the rig has the effect, the
model then predicts new motion better than a model without the effect.

**Halves of the data.** σ accounts for noise, but not for a model equation of the wrong form. A
wrong form makes the estimates from two halves of the data differ. The cross-validation has two
folds (`free_run.refits`). The training set of fold h is half h of the data: every other block of
each flight. The fit to half h gives the estimate θ_h of the term's first parameter, with the
standard error σ_h.

    u_h = (θ_h − θ_0)/σ_h
    both significant:    min_h |u_h| ≥ q, and u_1 and u_2 have the same sign
    estimates agree:     |θ_1 − θ_2| ≤ `SIGMAS_997` √(σ_1² + σ_2²)

q is the one-sided normal quantile of `LEVEL`. The two estimates do not count as significant if the
prior determines one of them more than the data do: both fits use this prior, so it makes their
estimates equal. If the parameter has a separate value for each recording, the estimates always
count as agreeing. u_h is then the normal deviate with the same two-sided p-value as χ̂² of half h.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from heli3dof.diagnosis.conclusion.doubtful_findings import are_of_equal_size
from heli3dof.diagnosis.constants import LEVEL
from heli3dof.diagnosis.free_run.elimination import (
    NORMAL,
    Elimination,
    TermResult,
    correlated_terms,
    known_beforehand,
)
from heli3dof.diagnosis.free_run.refits import refit, unknowns_of
from heli3dof.diagnosis.result import UndecidedTerms
from heli3dof.distributions import chi2_sf, normal_isf
from heli3dof.identification.greybox.freeflight import WEIGHT
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.identification.greybox.thrust_scale import thrust_scale
from heli3dof.model.physics.parametrisation import Structure, first_parameters

MOSTLY_PRIOR = "the recordings hardly determine its size: its interval is mostly that of the prior"


def probability_nonzero(fit: MultiStepFit, name: str) -> float:
    """Return the confidence level P at which a term's first parameter differs from its null value.

    P is 1 if the parameter has no null value or no σ.
    """
    distance = null_distance(fit, name)
    return 1.0 if distance is None else 2 * NORMAL.cdf(abs(distance.u)) - 1


def select_causes(result: Elimination) -> tuple[list[TermResult], list[TermResult]]:
    """Return (causes, terms that stay in the model but are no causes), as ordered in ``result``."""
    causes = [
        r
        for r in result.needed
        if probability_nonzero(result.fit, r.term) >= LEVEL and not contradicted(result, r)
    ]
    return causes, [*(r for r in result.needed if r not in causes), *result.removed]


def contradicted(result: Elimination, r: TermResult) -> str:
    """Return as text why the recordings do not confirm ``r`` as a cause; empty if they do."""
    if (d := null_distance(result.fit, r.term)) is not None and d.mostly_prior:
        return MOSTLY_PRIOR
    known = [d for h in result.halves if (d := null_distance(h, r.term)) is not None]
    if len(known) < 2:
        return ""
    if not estimates_agree(*known):
        return "the two halves of the data give it different sizes"
    if both_significant(*known) or r.term in known_beforehand(result.fit.problem):
        return ""
    return "it is not significant in each half of the data"


def confidence(result: Elimination, r: TermResult) -> float:
    """Return the probability that the term's size has the estimated sign.

    It is at most the share of bootstrap draws in which a fit without the term predicts held-out
    data worse. This limit does not apply if the prior alone shows that the term exists
    (`elimination.known_beforehand`).
    """
    sign = (1 + probability_nonzero(result.fit, r.term)) / 2
    known = r.term in known_beforehand(result.fit.problem)
    return sign if known else min(r.increase.positive, sign)


def open_terms(
    result: Elimination, causes: list[TermResult], only_kept: list[TermResult]
) -> UndecidedTerms:
    """Return the terms about which a further flight should give a decision.

    The function returns the first of these groups that is not empty:

    1. the first confounded cause and the terms confounded with it
    2. the terms that improve held-out predictions but are not causes
    3. the terms that are not identifiable
    """
    for r in causes:
        if r.tied_with:
            fit = result.fit
            for other in r.tied_with:
                if other not in {t.name for t in fit.structure.terms}:
                    fit = refit(fit, "", other)
            return UndecidedTerms(fit, (r.term, *r.tied_with), tied=True)
    needed = [r.term for r in only_kept if r not in result.removed]
    return UndecidedTerms(result.fit, tuple(needed or not_identifiable(result.fit, causes)))


def kept_terms(result: Elimination, only_kept: list[TermResult]) -> list[dict[str, Any]]:
    """Return a JSON object for each term in ``only_kept``: size, prior, why it is not a cause."""
    varying = {v.rsplit(".", 1)[0] for v in result.fit.problem.varying}
    as_what = "with one value per recording: "
    return [
        {
            "term": r.term,
            "parameters": sizes(result.fit, r.term),
            "why": as_what * (r.term in varying) + _why(result, r),
        }
        for r in only_kept
    ]


def _why(result: Elimination, r: TermResult) -> str:
    if (d := null_distance(result.fit, r.term)) is not None and d.mostly_prior:
        return MOSTLY_PRIOR
    if not result.halves:
        return "its size is not significant, and no blocks were left out"
    if r in result.removed:
        return "left-out blocks do not need it"
    if probability_nonzero(result.fit, r.term) >= LEVEL and (why := contradicted(result, r)):
        return f"left-out blocks need it, but {why}"
    alike = ", ".join(correlated_terms(result.fit, r.term))
    other = f" or a similar term ({alike})" if alike else ""
    return f"left-out blocks need it{other}, but its size is not significant"


def sizes(fit: MultiStepFit, name: str) -> dict[str, dict[str, float | str]]:
    """Return {parameter: JSON object} of a term in SI: estimate and σ, prior mean and σ, unit."""
    p, scale = fit.problem, thrust_scale(MeanTrimFit(fit))
    out: dict[str, dict[str, float | str]] = {}
    prior = p.start[: p.n]
    for j, f in enumerate(fit.structure.free):
        if f.term == name:
            value, std = scale.to_si(float(fit.values[j]), float(fit.std[j]), f.unit)
            out[f.name.removeprefix(f"{name}.")] = {
                "value": value,
                "std": std,
                "prior_mean": scale.to_si(float(f.unscaled(prior[j])), 0.0, f.unit)[0],
                "prior_std": scale.to_si(float(fit.prior_std[j]), 0.0, f.unit)[0],
                "unit": f.unit,
            }
    return out


def not_identifiable(fit: MultiStepFit, causes: list[TermResult]) -> Iterator[str]:
    """Yield the terms, other than ``causes``, that the recordings do not determine.

    For each parameter of such a term, the standard deviation of the estimate is hardly below that
    of the prior (`MultiStepFit.mostly_prior`). Parameters with a separate value for each recording
    are ignored.
    """
    cause_names = {r.term for r in causes}
    for t in fit.structure.terms:
        vague = [
            is_vague
            for f, is_vague in zip(fit.structure.free, fit.mostly_prior, strict=True)
            if f.term == t.name and f.name not in fit.problem.varying
        ]
        if vague and all(vague) and t.name not in cause_names:
            yield t.name


@dataclass(frozen=True, eq=False)
class MeanTrimFit(PhysicalFit):
    """A fit whose trim torque T_g includes the mean of the recordings' additional torques.

    A multi-step fit estimates the trim torque T_g and, for each recording, an additional torque τ_i
    (`mass.imbalance`). τ̄ is the mean of all τ_i. The recordings determine the sum T_g + τ̄, but not
    T_g and τ̄ separately. So this class has T_g + τ̄ in place of T_g, and zero in place of τ̄. The
    covariance matrix of the new parameters is J Σ Jᵀ. Σ is the covariance matrix of the parameters
    of ``fit``. J contains the derivatives of the new parameters with respect to those of ``fit``.
    """

    fit: MultiStepFit

    @property
    def structure(self) -> Structure:
        return self.fit.structure

    @cached_property
    def _combination(self) -> np.ndarray:
        names = self.structure.names
        J = np.eye(len(names))
        if WEIGHT in names:
            T_g, weight = names.index("T_g"), names.index(WEIGHT)
            J[T_g, weight], J[weight, weight] = 1.0, 0.0
        return J

    @property
    def theta(self) -> np.ndarray:
        values = self._combination @ self.fit.values
        return np.array([f.scaled(v) for f, v in zip(self.free, values, strict=True)])

    @cached_property
    def covariance(self) -> np.ndarray:
        return np.asarray(self._combination @ self.fit.covariance @ self._combination.T)


class NullDistance(NamedTuple):
    """Distance of a term's first parameter θ from θ_0, its value without the effect."""

    u: float
    """(θ − θ_0)/σ; ∞ if θ is on a logarithmic scale, where no value is without effect"""
    estimate: tuple[float, float] | None
    """Scaled value of θ and its σ; None if each recording has its own value of θ"""
    mostly_prior: bool = False
    """True if the prior determines θ more than the recordings do"""


def estimates_agree(a: NullDistance, b: NullDistance) -> bool:
    """Return whether two estimates of a parameter differ by at most `SIGMAS_997` σ.

    σ is the standard deviation of the difference. Parameters with a separate value for each
    recording are not compared: the result is True.
    """
    if a.estimate is None or b.estimate is None:
        return True
    return are_of_equal_size(a.estimate, b.estimate)


def both_significant(a: NullDistance, b: NullDistance) -> bool:
    """Return whether two estimates of a parameter are both significant, with the same sign.

    An estimate is significant if it differs from the parameter's null value (no effect) at the
    one-sided level `LEVEL`. The result is False if the prior determines an estimate more than the
    data do.
    """
    if a.mostly_prior or b.mostly_prior or math.copysign(1.0, a.u) != math.copysign(1.0, b.u):
        return False
    return min(abs(a.u), abs(b.u)) >= NORMAL.inv_cdf(LEVEL)


def null_distance(fit: MultiStepFit, name: str) -> NullDistance | None:
    """Return the distance of a term's first parameter from its null value, in standard deviations.

    The result is None if the term has no parameter, or if the fit gives no standard deviation.
    """
    j = first_parameters(fit.structure.free).get(name)
    if j is None:
        return None
    f, mostly_prior = fit.structure.free[j], bool(fit.mostly_prior[j])
    z, std = float(fit.z[j]), float(np.sqrt(fit.scaled_covariance[j, j]))
    if f.log:
        return NullDistance(math.inf, (z, std), mostly_prior)
    if f.name in fit.problem.varying:
        at = unknowns_of(fit.problem, j)[1:]
        d = fit.z[at] - f.scaled(f.null)
        chi2 = float(d @ np.linalg.solve(fit.scaled_covariance[np.ix_(at, at)], d))
        return NullDistance(equivalent_deviation(chi2, len(at)), None)
    return NullDistance((z - f.scaled(f.null)) / std, (z, std), mostly_prior) if std > 0 else None


def equivalent_deviation(chi2: float, freedom: int) -> float:
    """Return the standard normal deviate that has the same two-sided p-value as ``chi2``.

    ``freedom``: degrees of freedom of the χ² distribution.
    """
    return float(normal_isf(max(chi2_sf(chi2, freedom), 1e-300) / 2))
