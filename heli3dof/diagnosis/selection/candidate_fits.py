"""What may be the cause next, each fitted in full beside those found: the contenders of a step.

A fit starts where the screen saw its term, freed of the false slopes that the nulls have along the
term and the base (`estimate.corrected_maximum`); one that lost its way starts once more from near
nothing. What no probe sees is tried from its own starts (`screening.grid_trials`). Scores are
those of `selection.select`: 2 Δℓ_c/κ less the price of a term's numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.diagnosis.screening.grid_trials import GridTrial, beginning, rings, widened
from heli3dof.diagnosis.screening.nulls import Nulls
from heli3dof.diagnosis.screening.score_test import Screen, ScreenResult, with_term
from heli3dof.diagnosis.selection.parameter_price import price
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.model.effects import Term
from heli3dof.parallel import parallel_map

NEARER = 0.1
"""Of the way from nothing to where the screen saw a term: the start of a second attempt."""
OVERTAKES = 30.0
"""A full fit's score may be that many times its Z², where noise swelled to cover the cause."""


@dataclass(frozen=True, eq=False)
class CandidateFit:
    """One term beside those found already, fully fitted."""

    term: Term
    problem: Likelihood
    optimum: Optimum
    score: float
    """2 Δℓ_c/κ less the price of its numbers (`selection.parameter_price`)"""
    Z2: float
    probe: int | None
    """The screen's that saw it best; None for a term that no probe sees"""


def fit_candidates(
    found: CorrectedFit, screen: Screen, seen: ScreenResult, nulls: Nulls, bias: np.ndarray,
    ranked: Sequence[tuple[Term, float, int]], tried: Sequence[GridTrial] = (),
) -> list[CandidateFit]:  # fmt: skip
    """The terms beside ``found``, fitted, best first; those that diverged or ran into a bound left
    out."""
    if not ranked and not tried:
        return []
    o, problem = found.optimum, found.problem
    none = np.zeros(3) if found.noise_bias is None else found.noise_bias
    level = maximise_corrected(problem, o.theta, o.noise, ScoreBias(bias, none, o.theta, o.noise))
    played = {t.name for t in problem.structure.terms if t.effect.starts}

    def scored(
        term: Term, ext: Likelihood, fit: Optimum, kappa: float = nulls.inflation
    ) -> float | None:
        """None for a fit that diverged or ran into a bound."""
        if fit.at_bound[len(o.theta) :].any() or not np.isfinite(fit.loglik):
            return None
        won = 2 * (fit.loglik - level.loglik) / kappa
        # What a simpler base leaves out has no number to be bought: its share is believed to be 1.
        return float(won - (0.0 if term.effect.of_base else price(ext, fit, term.name, kappa)))

    def one(k: int) -> CandidateFit | None:
        term, Z2, i = ranked[k]
        wide, _ = with_term(problem.structure, found.values, term)
        ext = replace(problem, structure=wide)
        start = beginning_of(
            ext, found, seen, i, 1 - nulls.mean[i] / seen.z[i] if seen.z[i] else 1.0
        )
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
        tilt = ScoreBias(np.append(bias, slope), none, np.append(o.theta, theta_0), o.noise)
        # The likelihood along a play that was found is jagged: what is beside it is climbed alone.
        jagged = np.array([f.term in played for f in wide.free])
        begin = np.append(level.theta, start[len(o.theta) :])
        fit = maximise_corrected(ext, begin, level.noise, tilt, hold=jagged)
        shape = fit.at_bound.copy()
        shape[: len(o.theta) + 1] = False
        if shape.any():
            # What shape it has the recordings do not tell: that stays as it is believed to be.
            fit = maximise_corrected(ext, begin, level.noise, tilt, hold=jagged | shape)
        if not fit.loglik > level.loglik and not new[0].log:
            # It lost its way: absent it does as well as the level, so from near there it must win.
            near, at = begin.copy(), len(o.theta)
            absent = new[0].inward(new[0].null)
            near[at] = absent + NEARER * (near[at] - absent)
            fit = maximise_corrected(ext, near, level.noise, tilt, rounds=28, hold=jagged)
        score = scored(term, ext, fit)
        return None if score is None else CandidateFit(term, ext, fit, score, Z2, i)

    def trial(k: int) -> CandidateFit | None:
        term = tried[k].term
        ext = widened(problem, o.theta, term)
        start, noise = beginning(ext, level.theta, level.noise, term)
        new = ext.structure.free[len(o.theta) :]
        no_slope = np.append(bias, np.zeros(len(new)))
        tilt = ScoreBias(no_slope, none, np.append(o.theta, start[len(o.theta) :]), o.noise)
        fit = maximise_corrected(ext, start, noise, tilt)
        # Where noise hides a ringing loop the nulls' slopes say nothing of how likelihoods scatter.
        score = scored(
            term, ext, fit, max(found.inflation, 1.0) if rings(term) else nulls.inflation
        )
        return None if score is None else CandidateFit(term, ext, fit, score, score, None)

    fits = [f for f in parallel_map(trial, len(tried), what="fits") if f is not None]
    most = max((f.score for f in fits), default=0.0)
    ranked = [r for r in ranked if OVERTAKES * r[1] > most]
    fits += [f for f in parallel_map(one, len(ranked), what="fits") if f is not None]
    return sorted(fits, key=lambda f: -f.score)


def beginning_of(
    ext: Likelihood, found: CorrectedFit, seen: ScreenResult, i: int, true: float
) -> np.ndarray:
    """(n,) coordinates: the estimate, and the new term where the screen saw it.

    ``true``: the share of the probe's score that its nulls do not have too.
    """
    probe = seen.probes[i]
    new = ext.structure.free[len(found.free) :]
    guess = list(probe.values)
    first = new[0]
    if not first.log and first.low < first.null < first.high:
        guess[0] = first.null + float(np.clip(true, 0.0, 1.5) * seen.amplitude[i])
    inside = []
    for v, f in zip(guess, new, strict=True):
        if f.log:
            inside.append(f.inward(min(max(v, f.low * 1.1), f.high / 1.1)))
        else:
            room = min(0.01 * (f.high - f.low), 0.05 * f.typical)
            inside.append(f.inward(min(max(v, f.low + room), f.high - room)))
    return np.concatenate([found.optimum.theta, inside])
