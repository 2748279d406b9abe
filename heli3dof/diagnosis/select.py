"""Which causes: screened, fitted, compared; one after another, then each once more without it.

The screen's Z² (calibrated by the nulls) says whether there is anything; full fits of the
likeliest terms say which, on the likelihood freed of its false slopes (`tilted`). With κ the
nulls' inflation and n a term's parameters

    score = 2 Δℓ_c / κ − n ln N

(BIC; N the encoders' events). A further cause must exceed `SHARE` of the first one's score.
Diverged fits and fits on a bound are refused. Terms within `TIE` of the best are tied with it, and
so are those within a share `FORM` of its score: a term is only as right as its formula, and a rig's
friction, lag or drag is not any formula to better than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.corrected import Corrected, in_threads
from heli3dof.diagnosis.nulls import Nulls
from heli3dof.diagnosis.screen import Screen, Seen, with_term
from heli3dof.diagnosis.tilted import Tilt, maximise_tilted
from heli3dof.identification.greybox.fit import Optimum
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.effects import Term

FITTED = 10
HOPELESS = 0.1
"""Of the largest Z²: below it no term is fitted."""
TIE = 6.0
FORM = 0.1
SHARE = 0.05
LARGE = 5.0
MOST = 4
"""Causes that are looked for, at most."""


@dataclass(frozen=True, eq=False)
class Contender:
    """One term beside those found already, fully fitted."""

    term: Term
    problem: Likelihood
    optimum: Optimum
    score: float
    """2 Δℓ_c/κ less ln N for each parameter"""
    Z2: float


@dataclass(frozen=True, eq=False)
class Choice:
    """One step: the term taken, and what it is tied with."""

    term: Term
    score: float
    Z2: float
    confidence: float
    tied_with: tuple[str, ...]
    contenders: tuple[Contender, ...]
    """Best first; the term's own fit is the first one's."""


def suspects(seen: Seen, nulls: Nulls) -> list[tuple[Term, float, int]]:
    """Terms by their best probe's Z², largest first: (term, Z², probe)."""
    Z = nulls.judged(seen)
    scanned = np.array([p.size == a for p, a in zip(seen.probes, seen.amplitude, strict=True)])
    Z2 = np.where(scanned & (Z < 0), 0.0, Z**2)
    best: dict[str, tuple[Term, float, int]] = {}
    for i, p in enumerate(seen.probes):
        if p.name not in best or Z2[i] > best[p.name][1]:
            best[p.name] = (p.term, float(Z2[i]), i)
    return sorted(best.values(), key=lambda b: -b[1])


def choose(
    found: Corrected, screen: Screen, seen: Seen, nulls: Nulls, bias: np.ndarray,
    first_score: float | None,
) -> Choice | None:  # fmt: skip
    """The next cause beside those of ``found``; None where nothing more is there.

    ``bias`` (n,): the mean scores of the nulls along the parameters of ``found``.
    """
    hidden = unidentifiable(screen, nulls)
    ranked = [r for r in suspects(seen, nulls) if r[0].name not in hidden]
    if not ranked or ranked[0][1] < nulls.threshold:
        return None
    ranked = [r for r in ranked[:FITTED] if r[1] >= HOPELESS * ranked[0][1]]
    fits = contend(found, screen, seen, nulls, bias, ranked)
    if not fits:
        return None
    best = fits[0]
    if best.score <= 0 or nulls.threshold / 2 > best.Z2:
        return None
    if first_score is not None and best.score < SHARE * first_score:
        return None
    tied = tuple(
        f.term.name for f in fits[1:] if best.score - f.score < max(TIE, FORM * best.score)
    )
    return Choice(best.term, best.score, best.Z2, nulls.confidence(best.Z2), tied, tuple(fits))


def unidentifiable(screen: Screen, nulls: Nulls) -> tuple[str, ...]:
    """Terms of which even a large size (`LARGE` × typical) stays below 3 σ in these recordings.

    A number that is found for one of them is one that a rig cannot have.
    """
    sigma = nulls.std[: len(screen.plain)] / np.sqrt(np.maximum(screen.information(), 1e-300))
    best: dict[str, float] = {}
    for p, s in zip(screen.plain, sigma, strict=True):
        share = 3 * float(s) / (LARGE * p.term.effect.parameters[0].typical)
        best[p.name] = min(best.get(p.name, np.inf), share)
    return tuple(n for n, share in best.items() if share > 1)


def contend(
    found: Corrected, screen: Screen, seen: Seen, nulls: Nulls, bias: np.ndarray,
    ranked: Sequence[tuple[Term, float, int]],
) -> list[Contender]:  # fmt: skip
    """The terms beside ``found``, fitted, best first; those that diverged or ran into a bound left
    out."""
    o, problem = found.optimum, found.problem
    none = np.zeros(3) if found.noise_bias is None else found.noise_bias
    level = maximise_tilted(problem, o.theta, o.noise, Tilt(bias, none, o.theta, o.noise))
    rows = max(len(o.at.row), 2)

    def one(k: int) -> Contender | None:
        term, Z2, i = ranked[k]
        wide, _ = with_term(problem.structure, found.values, term)
        ext = replace(problem, structure=wide)
        start = beginning_of(ext, found, seen, i)
        new = wide.free[len(o.theta) :]
        slope, theta_0 = np.zeros(len(new)), start[len(o.theta) :].copy()
        if i < len(screen.plain) and screen.plain[i].grows and np.isfinite(screen.v[i]):
            raw = nulls.mean[i] * np.sqrt(screen.v[i]) + screen.solved[:, i] @ bias
            per = raw / screen.plain[i].size
            if new[0].log:  # as if it grew in proportion to the parameter, from nothing
                slope[0] = per * new[0].outward(theta_0[0])
                theta_0[0] -= 1.0
            else:
                slope[0] = per * new[0].typical
                theta_0[0] = new[0].inward(new[0].null)
        tilt = Tilt(np.append(bias, slope), none, np.append(o.theta, theta_0), o.noise)
        fit = maximise_tilted(ext, np.append(level.theta, start[len(o.theta) :]), level.noise, tilt)
        if fit.at_bound[len(o.theta) :].any() or not np.isfinite(fit.loglik):
            return None
        won = 2 * (fit.loglik - level.loglik) / nulls.inflation
        return Contender(term, ext, fit, float(won - len(new) * np.log(rows)), Z2)

    fits = [f for f in in_threads(one, len(ranked)) if f is not None]
    return sorted(fits, key=lambda f: -f.score)


def beginning_of(ext: Likelihood, found: Corrected, seen: Seen, i: int) -> np.ndarray:
    """(n,) coordinates: the estimate, and the new term where the screen saw it."""
    probe = seen.probes[i]
    new = ext.structure.free[len(found.free) :]
    guess = list(probe.values)
    first = new[0]
    if not first.log and first.low < first.null < first.high:
        guess[0] = first.null + float(seen.amplitude[i])
    inside = []
    for v, f in zip(guess, new, strict=True):
        if f.log:
            inside.append(f.inward(min(max(v, f.low * 1.1), f.high / 1.1)))
        else:
            room = 0.01 * (f.high - f.low)
            inside.append(f.inward(min(max(v, f.low + room), f.high - room)))
    return np.concatenate([found.optimum.theta, inside])
