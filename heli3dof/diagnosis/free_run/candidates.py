"""Score test of every effect that a multi-step fit lacks, without fitting any.

A multi-step fit minimises the cost Q = r·r + (z − z_0)ᵀ Λ (z − z_0), where

- r (R,): weighted residuals of the predictions (`heli3dof.identification.greybox.multistep`)
- z (dim,): scaled parameters
- z_0, Λ: mean and precision matrix of their prior

Q corresponds to −2 ln L. Each effect is tested at trial values of its parameters
(`search.catalogue`). A simulation of the model with the effect gives d (R,), the change of r. If r
is linear in the parameters, the effect decreases the minimum of Q by Z² = u²/v:

    u = −d·(r − Dᵀ H⁻¹ (D r + Λ (z − z_0)))        score
    v = d·d − (D d)ᵀ H⁻¹ (D d)                     information on the effect's size
    D = ∂r/∂z (dim, R),   H = D Dᵀ + Λ

The terms with H⁻¹ allow for a refit of z: they remove the part of d that a change of z can produce.

**Confounded effects.** A tested effect may be confounded with a cause that the fitted model already
contains. Let w (R,) be the change of r if the cause is removed from the model. A change of the
other fitted parameters can produce a part of d and a part of w. d̃ and w̃ are d and w without these
parts. Removal of the cause increases Q. To first order, the tested effect can cancel the share
ρ² = (d̃·w̃)²/(d̃·d̃ w̃·w̃) of this increase. If |ρ| > `CORRELATED`, the effect may be confounded with
the cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.constants import MAX_CAUSES, MAX_COMPARED
from heli3dof.diagnosis.free_run.refits import (
    carried_over,
    least_squares,
    parameter_of_unknown,
    refit,
    restructured,
    without_effects,
)
from heli3dof.diagnosis.search.catalogue import Probe, candidates, probes
from heli3dof.diagnosis.search.nulls import bonferroni
from heli3dof.diagnosis.search.screening import one_sided
from heli3dof.identification.bias_correction.perturbation import project_out
from heli3dof.identification.bias_correction.scans import MIN_INFORMATION_SHARE
from heli3dof.identification.greybox.multistep import MultiStepFit
from heli3dof.parallel import parallel_map

CORRELATED = 0.5
"""|Correlation| above which two effects may be confounded. Chosen."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """The score test of the effect ``name`` at trial values of its parameters."""

    name: str
    change: np.ndarray
    """(R,) d, the change of the residuals"""
    Z2: float
    """Z²; zero if the effect would have the wrong sign, such as a negative friction"""


def score_tests(fit: MultiStepFit) -> list[Candidate]:
    """Return the score test of each effect that ``fit`` lacks, largest Z² first.

    An effect may be tested with several trial values of its parameters. Only its test with the
    largest Z² is returned. ``formal`` effects are not tested. They change only the form of the
    rigid body's equations, for example omit couplings, so they cannot be causes.
    """
    p = fit.problem
    V = np.concatenate([f.V for f in p.flights])
    present = [t.name for t in fit.structure.terms]
    terms = [t for t in candidates(present) if not t.effect.formal]
    tested = [q for t in terms for q in probes(t, V)]
    r = least_squares(fit, p).residuals(fit.z)
    H = fit.information
    step = np.linalg.solve(H, fit.tangents @ r + p.prior @ (fit.z - p.start))
    q = r - step @ fit.tangents

    def one(i: int) -> Candidate:
        d = _with_probe(fit, tested[i]) - r
        d_own = project_out(d, fit.tangents, H)
        v = float(d @ d_own)
        if not v > MIN_INFORMATION_SHARE * float(d @ d):
            return Candidate(tested[i].name, d, 0.0)
        u = -float(d @ q)
        wrong_sign = u < 0 and one_sided(tested[i])
        return Candidate(tested[i].name, d, 0.0 if wrong_sign else u * u / v)

    best: dict[str, Candidate] = {}
    for c in parallel_map(one, len(tested), what="candidates"):
        if c.name not in best or c.Z2 > best[c.name].Z2:
            best[c.name] = c
    return sorted(best.values(), key=lambda c: -c.Z2)


def with_further_effects(fit: MultiStepFit) -> MultiStepFit:
    """Return the fit with further effects of the catalogue that reduce its cost significantly."""
    for _ in range(MAX_CAUSES):
        tests = score_tests(fit)
        least = bonferroni(len(tests))
        names = [c.name for c in tests if least <= c.Z2][:MAX_COMPARED]
        wider = [refit(fit, "", instead=name) for name in names]
        best = min(wider, key=lambda w: w.cost, default=fit)
        if fit.cost - best.cost < least:
            break
        fit = best
    return fit


def possible_replacements(fit: MultiStepFit, name: str, tests: Sequence[Candidate]) -> list[str]:
    """Return the tested effects that may be confounded with the term ``name`` of the fit.

    The effect with the largest ρ² (see the module) is first.
    """
    p = fit.problem
    own = np.array([fit.structure.free[j].term == name for j in parameter_of_unknown(p)])
    D = fit.tangents[~own]
    H = D @ D.T + p.prior[np.ix_(~own, ~own)]
    w = project_out((without_effects(p) - fit.z)[own] @ fit.tangents[own], D, H)

    def share(c: Candidate) -> float:
        d = project_out(c.change, D, H)
        return float((d @ w) ** 2 / max((d @ d) * (w @ w), 1e-300))

    shares = {c.name: share(c) for c in tests}
    return sorted((n for n, s in shares.items() if s > CORRELATED**2), key=lambda n: -shares[n])


def _with_probe(fit: MultiStepFit, probe: Probe) -> np.ndarray:
    """Return the residuals (R,) of the fit with an effect added at the values in ``probe``."""
    p = fit.problem
    new = restructured(p, [*(t.name for t in fit.structure.terms), probe.name])
    z, _ = carried_over(fit, new)
    z[p.n : new.n] = [
        f.scaled(value) for f, value in zip(new.structure.free[p.n :], probe.values, strict=True)
    ]
    return least_squares(fit, new).residuals(z)
