"""Which causes: screened, fitted, compared; one after another, then each once more without it.

The screen's Z² (calibrated by the nulls) says whether there is anything; full likelihood fits of
the best `FITTED` terms say which. Twice the log-likelihood that a term wins, L, is scaled by what
the nulls left of the screen's score, so that a fake does not win by a fake likelihood. A further
cause must exceed `SHARE` of the first one's L. Diverged fits and fits on a bound are refused.
Terms within `TIE` of the best are tied with it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.nulls import Nulls
from heli3dof.diagnosis.screen import Screen
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.model.effects import Term
from heli3dof.model.rig_model import Structure

FITTED = 5
TIE = 6.0
SHARE = 0.05
MOST = 4
"""Causes that are looked for, at most."""


@dataclass(frozen=True, eq=False)
class Choice:
    """One step: the term taken, its fit, what it is tied with."""

    term: Term
    fit: Estimate
    score: float
    """Twice the log-likelihood won, less ln N for each parameter."""
    Z2: float
    confidence: float
    tied_with: tuple[str, ...]


def suspects(seen: Screen, nulls: Nulls) -> list[tuple[Term, float, int]]:
    """Terms by their best probe's Z², largest first: (term, Z², probe)."""
    Z2 = nulls.judged(seen.z) ** 2
    best: dict[str, tuple[Term, float, int]] = {}
    for i, p in enumerate(seen.probes):
        if p.name not in best or Z2[i] > best[p.name][1]:
            best[p.name] = (p.term, float(Z2[i]), i)
    return sorted(best.values(), key=lambda b: -b[1])


def choose(found: Estimate, seen: Screen, nulls: Nulls, first_score: float | None) -> Choice | None:
    """The next cause beside those of ``found``; None where nothing more is there."""
    ranked = suspects(seen, nulls)
    if not ranked or ranked[0][1] < nulls.threshold:
        return None
    rows = max(found.problem.data.rows, 2)
    fits = []
    for term, Z2, i in ranked[:FITTED]:
        if 0.1 * ranked[0][1] > Z2:
            continue
        fit = extended(found, term, seen.probes[i].values, float(seen.amplitude[i]))
        n = len(term.effect.parameters)
        new = slice(len(found.free), None)
        if not fit.optimum.converged or fit.optimum.at_bound[new].any():
            continue
        won = 2 * (fit.optimum.loglik - found.optimum.loglik)
        left = min(1.0, Z2 / max(float(seen.z[i]) ** 2, 1e-9))
        fits.append((won * left - n * np.log(rows), Z2, term, fit))
    fits.sort(key=lambda f: -f[0])
    if not fits or fits[0][0] <= 0 or fits[0][1] < nulls.threshold:
        return None
    score, Z2, term, fit = fits[0]
    if first_score is not None and score < SHARE * first_score:
        return None
    tied = tuple(t.name for s, _, t, _ in fits[1:] if score - s < TIE)
    return Choice(term, fit, float(score), Z2, nulls.confidence(Z2), tied)


def extended(found: Estimate, term: Term, probe: tuple[float, ...], amplitude: float) -> Estimate:
    """The base and its terms with one more, fitted from where the screen saw it."""
    structure = Structure(found.structure.profile, (*found.structure.terms, term))
    problem = replace(found.problem, structure=structure)
    new = structure.free[len(found.free) :]
    first = new[0]
    guess = list(probe)
    guess[0] = first.null + amplitude
    if first.log or first.low >= first.null or first.high <= first.null:
        guess[0] = probe[0]  # a shape found at its own size
    inside = [
        min(max(v, f.low + 0.01 * (f.high - f.low)), f.high - 0.01 * (f.high - f.low))
        if not f.log
        else min(max(v, f.low * 1.1), f.high / 1.1)
        for v, f in zip(guess, new, strict=True)
    ]
    start = np.concatenate(
        [found.optimum.theta, [f.inward(v) for v, f in zip(inside, new, strict=True)]]
    )
    return estimate(problem, start=start, noise=found.optimum.noise)


def without(found: Estimate, term: Term) -> Estimate:
    """The same fit without one of its terms: for backward elimination and for gains."""
    keep = tuple(t for t in found.structure.terms if t.name != term.name)
    structure = Structure(found.structure.profile, keep)
    given = dict(zip(found.structure.names, found.values.tolist(), strict=True))
    problem = replace(found.problem, structure=structure)
    start = problem.coordinates(structure.values_of(given))
    return estimate(problem, start=start, noise=found.optimum.noise)
