"""Refit the current model with one candidate added, for each candidate of a step.

A candidate is a term: an effect on one axis. The refit maximises the bias-corrected log-likelihood
ℓ_c (`bias_correction.corrected_maximum`). Δℓ_c is its increase over the current fit. κ is the
variance inflation of the scores in null simulations, which contain no further effect
(`search.nulls`). N is the number of filter updates. The score of a term is its gain in BIC:

    score = 2 Δℓ_c/κ − m ln N

m is the number of the term's parameters. A term that only selects a form of the equations of motion
(`Effect.of_base`) has m = 0: a narrow prior already limits its parameter.

The refit with a term starts at the trial values at which the score test has the largest Z²
(`search.screening`). If ℓ_c does not exceed that of the current fit, the refit is repeated from a
size near zero. If the score test cannot detect the term, the refit starts at the best value of a
grid (see below).

A periodic torque may have a different phase in each of R recordings. So time shifts of the
recordings give the torque the same phase in all of them (`bias_correction.scans`). R − 1 of these
shifts count as parameters. No recording is shifted if the current fit already contains the phase of
a periodic torque or the instant of a mass change.

**Grid trials.** ℓ is the log-likelihood. Its derivative with respect to encoder backlash is zero at
zero backlash, so the score test cannot detect backlash. Instead, the gain Δℓ is computed at values
w of the term's first parameter:

    Δℓ(w) = ℓ(θ, w, a) − ℓ(θ, 0, a)

θ and a are the current fit's parameters and noise intensities. w increases along the term's grid as
long as Δℓ(w) rises; ŵ is the last value before Δℓ falls. The model is refitted with the term if
both hold:

1. Δℓ(ŵ) > `MIN_TRIAL_GAIN`.
2. If flights can be simulated: Δℓ(ŵ) > max Δℓ_null(ŵ) + `MIN_TRIAL_GAIN`. Δℓ_null is the gain in a
   flight simulated from the current fit. The maximum is over all these flights. Without this
   condition, an axis with little motion could have a large Δℓ by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.search.score_test import ScreenResult
from heli3dof.diagnosis.search.screening import Screening
from heli3dof.identification.bias_correction.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.identification.bias_correction.correction import CorrectedFit, Start
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum, noise_step
from heli3dof.model.effects import Term
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.model.estimation.filter_data import Data, with_shifted_time
from heli3dof.parallel import parallel_map

SECOND_START = 0.1
"""Start of a second refit, as a share of the trial value. Chosen; not derived."""
MAX_SCORE_PER_Z2 = 30.0
"""Largest expected score/Z²; over 1 because the base fit may attribute a cause to noise. Chosen."""
MIN_TRIAL_GAIN = 40.0
"""Least Δℓ for a refit with the term. Chosen: Δℓ is over 100 with backlash, below −100 without."""
NOISE_ROUNDS, NOISE_TOLERANCE = 4, 0.1
"""Most noise updates at one grid value; they end if ln a changes by less. Chosen; not derived."""
NEIGHBOURS = 3
"""Values on either side of the best one that are evaluated in the second round. Chosen."""


@dataclass(frozen=True, eq=False)
class CandidateFit:
    """The result of refitting the current model with one candidate effect added."""

    term: Term
    problem: Likelihood
    optimum: Optimum
    score: float
    """2 Δℓ_c/κ − m ln N"""
    Z2: float | None
    """Largest Z² of the term's score tests; None for a term without a score test"""
    probe: int | None
    """Index of the trial values with this Z²; None for a term without a score test"""

    @property
    def statistic(self) -> float:
        """Return the number to compare with the threshold of Z²: Z², or the score if Z² is None."""
        return self.score if self.Z2 is None else self.Z2


@dataclass(frozen=True)
class GridTrial:
    """A term with the trial ``value`` of its first parameter, and its gain in log-likelihood."""

    term: Term
    value: float
    gain: float
    """Δℓ"""


def trials(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, untested: Sequence[Term]
) -> list[GridTrial]:
    """Return those of the ``untested`` terms that gain Δℓ > `MIN_TRIAL_GAIN`, at their best values.

    Each term is added to the current fit at increasing values of its first parameter, as long as
    the gain Δℓ in log-likelihood rises. The current fit has the parameters ``theta`` (n,) and the
    ``noise`` (4,): process noise of three axes, and sampling jitter.
    """
    base = float(problem.loglik(theta, noise).sum())

    def one(k: int) -> GridTrial:
        ext = problem.with_term(untested[k])
        best = GridTrial(untested[k], 0.0, -np.inf)
        for value in untested[k].effect.starts:
            at = np.append(theta, ext.structure.free[-1].scaled(value))
            gain = float(ext.loglik(at, noise).sum()) - base
            if not gain > best.gain:
                break
            best = GridTrial(untested[k], value, gain)
        return best

    return [t for t in parallel_map(one, len(untested), what="trials") if t.gain > MIN_TRIAL_GAIN]


def exceeds_nulls(
    trial: GridTrial,
    problem: Likelihood,
    theta: np.ndarray,
    noise: np.ndarray,
    nulls: Sequence[Data],
) -> bool:
    """Return True if a term gains much more log-likelihood in the recordings than by chance.

    The gain Δℓ is that of adding the trial's term at its trial value. Δℓ of the recordings must
    exceed Δℓ of each simulated flight in ``nulls`` by more than `MIN_TRIAL_GAIN`. These flights
    were simulated without the term.
    """
    ext, at = with_term_at(problem, theta, trial.term, (trial.value,))

    def one(b: int) -> float:
        extended = replace(ext, data=nulls[b]).loglik(at, noise).sum()
        base = replace(problem, data=nulls[b]).loglik(theta, noise).sum()
        return float(extended - base)

    gains = np.array(parallel_map(one, len(nulls), what="flights"))
    return bool(trial.gain > gains.max() + MIN_TRIAL_GAIN)


def with_term_at(
    problem: Likelihood, theta: np.ndarray, term: Term, values: Sequence[float]
) -> tuple[Likelihood, np.ndarray]:
    """Return the likelihood with ``term`` added, and its scaled parameters θ (n + m,).

    The first n are ``theta`` (n,), the scaled parameters of ``problem``. The other m are the term's
    parameters, with the ``values`` (m,) in their units.
    """
    ext = problem.with_term(term)
    new = zip(ext.structure.free[len(theta) :], values, strict=False)
    return ext, np.append(theta, [f.scaled(v) for f, v in new])


def fit_candidates(
    s: Screening, ranked: Sequence[tuple[Term, float, int]], tried: Sequence[GridTrial] = ()
) -> list[CandidateFit]:
    """Refit the model with each ``ranked`` and each ``tried`` term; return the refits by score.

    The refit with the highest score is first. ``ranked``: entries of `Screening.ranked`, which
    contain a term and its Z², the statistic of its score test. ``tried``: terms that the score test
    cannot detect. They were evaluated at trial values instead, and are refitted first.

    The refit with a ranked term is expected to have a score of at most `MAX_SCORE_PER_Z2` · Z². If
    this limit does not exceed the best score of the tried terms, the function skips the ranked
    term. Refits that diverge, or in which a parameter of the term ends at a bound, are omitted.
    """
    if not ranked and not tried:
        return []
    current, screen, result, nulls, bias = s.fit, s.screen, s.recorded, s.nulls, s.bias
    o, problem = current.optimum, current.problem
    none = np.zeros(3) if current.noise_bias is None else current.noise_bias
    level = maximise_corrected(problem, o.theta, o.noise, ScoreBias(bias, none, o.theta, o.noise))
    backlash = {t.name for t in problem.structure.terms if t.effect.starts}

    def scored(term: Term, fit: Optimum, shifts: int = 0) -> float | None:
        """Return the score of ``fit``: its gain in BIC over the current fit, which lacks ``term``.

        The score is None if the fit diverged, or if a parameter of the term ended at a bound. A
        periodic torque has a different phase in each recording. So the time of each recording is
        shifted until the torque has the same phase in all recordings. ``shifts``: number of these
        time shifts; each counts as one parameter in the score.
        """
        if fit.at_bound[len(o.theta) :].any() or not np.isfinite(fit.loglik):
            return None
        won = 2 * (fit.loglik - level.loglik) / nulls.inflation
        # A part of the body's equations has no penalty: its share has a tight prior.
        m = 0 if term.effect.of_base else len(fit.theta) - len(o.theta) + shifts
        return float(won - bic_penalty(m, fit.at))

    def one(k: int) -> CandidateFit | None:
        term, Z2, i = ranked[k]
        ext = problem.with_term(term)
        time_shifts = result.probes[i].time_shifts
        if any(f.per_recording for f in problem.structure.free):
            time_shifts = ()
        if time_shifts:
            ext = replace(ext, data=with_shifted_time(ext.data, time_shifts))
        start = start_at_probe(
            ext, current, result, i, 1 - nulls.mean[i] / result.z[i] if result.z[i] else 1.0
        )
        new = ext.structure.free[len(o.theta) :]
        slope, theta_0 = np.zeros(len(new)), start[len(o.theta) :].copy()
        if i < len(screen.plain) and screen.plain[i].size is not None and np.isfinite(screen.v[i]):
            raw = nulls.mean[i] * np.sqrt(screen.v[i]) + screen.solved[:, i] @ bias
            per = raw / screen.plain[i].size
            if new[0].log:  # slope along the logarithm of an effect that grows linearly from zero
                slope[0] = per * new[0].unscaled(theta_0[0])
                theta_0[0] -= 1.0
            else:
                slope[0] = per * new[0].typical
                theta_0[0] = new[0].scaled(new[0].null)
        score_bias = ScoreBias(np.append(bias, slope), none, np.append(o.theta, theta_0), o.noise)
        # The likelihood has many local maxima along a backlash width, so this width is held fixed.
        jagged = np.array([f.term in backlash for f in ext.structure.free])
        begin = np.append(level.theta, start[len(o.theta) :])
        fit = maximise_corrected(ext, begin, level.noise, score_bias, hold=jagged)
        held = fit.at_bound.copy()
        held[: len(o.theta) + 1] = False
        if fit.at_bound[len(o.theta)]:  # its other parameters may have moved the size there
            held[len(o.theta) + 1 :] = True
        if held.any():
            # The recordings do not determine these parameters: hold them at their start.
            fit = maximise_corrected(ext, begin, level.noise, score_bias, hold=jagged | held)
        if not fit.loglik > level.loglik and not new[0].log:
            # Near zero the likelihood is that of the current fit, so an ascent from there gains.
            again, at = begin.copy(), len(o.theta)
            absent = new[0].scaled(new[0].null)
            again[at] = absent + SECOND_START * (again[at] - absent)
            fit = maximise_corrected(ext, again, level.noise, score_bias, rounds=28, hold=jagged)
        score = scored(term, fit, max(len(time_shifts) - 1, 0))
        return None if score is None else CandidateFit(term, ext, fit, score, Z2, i)

    def trial(k: int) -> CandidateFit | None:
        term = tried[k].term
        ext = problem.with_term(term)
        start, noise = fit_start(ext, level.theta, level.noise, term)
        new = ext.structure.free[len(o.theta) :]
        no_slope = np.append(bias, np.zeros(len(new)))
        score_bias = ScoreBias(no_slope, none, np.append(o.theta, start[len(o.theta) :]), o.noise)
        fit = maximise_corrected(ext, start, noise, score_bias)
        score = scored(term, fit)
        return None if score is None else CandidateFit(term, ext, fit, score, None, None)

    fits = [f for f in parallel_map(trial, len(tried), what="fits") if f is not None]
    best = max((f.score for f in fits), default=0.0)
    ranked = [r for r in ranked if MAX_SCORE_PER_Z2 * r[1] > best]
    fits += [f for f in parallel_map(one, len(ranked), what="fits") if f is not None]
    return sorted(fits, key=lambda f: -f.score)


def correction_starts(optimum: Optimum, current: CorrectedFit | None) -> list[Start]:
    """Return the starts of an optimum's bias correction: the optimum, and one near ``current``.

    The second start has the parameters and noise of the fit ``current``. Parameters that
    ``current`` lacks have their values in the optimum. Without ``current``, there is no second
    start.
    """
    starts = [(optimum.theta, optimum.noise)]
    if current is not None:
        theta = np.append(current.theta, optimum.theta[len(current.theta) :])
        starts.append((theta, current.optimum.noise))
    return starts


def bic_penalty(m: int, at: FilterRun) -> float:
    """Return BIC's penalty m ln N of ``m`` parameters; N: number of filter updates in ``at``."""
    return m * float(np.log(max(len(at.row), 2)))


def start_at_probe(
    ext: Likelihood, current: CorrectedFit, result: ScreenResult, i: int, unbiased: float
) -> np.ndarray:
    """Return the parameters (n + m,) at which a fit with a new term of m parameters starts.

    The first n are those of the ``current`` fit. The other m are the trial values at which the
    score test evaluated the term; i is their index in ``result``. If the effect can have either
    sign, the score test's estimate of its size replaces the first value. The factor ``unbiased``
    corrects this estimate for bias. It is (z − z̄)/z, with the score z and its mean z̄ over the null
    simulations. ``ext``: likelihood with the new term.
    """
    probe = result.probes[i]
    new = ext.structure.free[len(current.free) :]
    guess = list(probe.values)
    first = new[0]
    if probe.size is not None and not first.log and first.low < first.null < first.high:
        guess[0] = first.null + float(np.clip(unbiased, 0.0, 1.5) * result.amplitude[i])
    inside = []
    for v, f in zip(guess, new, strict=True):
        if f.log:
            inside.append(f.scaled(min(max(v, f.low * 1.1), f.high / 1.1)))
        else:
            room = min(0.01 * (f.high - f.low), 0.05 * f.typical)
            inside.append(f.scaled(min(max(v, f.low + room), f.high - room)))
    return np.concatenate([current.optimum.theta, inside])


def refit_with_term(
    fit: Estimate, term: Term, values: Sequence[float]
) -> tuple[Likelihood, Optimum]:
    """Return the likelihood of ``fit`` extended by ``term``, and its maximum (no bias correction).

    ``values``: the values of the term's parameters at which the search starts, in their units.
    """
    o = fit.optimum
    problem, start = with_term_at(fit.problem, o.theta, term, values)
    return problem, maximise_corrected(problem, start, o.noise, None)


def fit_start(
    ext: Likelihood, theta: np.ndarray, noise: np.ndarray, term: Term
) -> tuple[np.ndarray, np.ndarray]:
    """Return the start of a fit with ``term``: parameters (n + m,) and ``noise`` (4,).

    ``theta`` (n,): current fit; m: number of the term's parameters. The term's first parameter is
    the best value on its grid. A first search evaluates every other grid value, a second search the
    neighbours of the best one.
    """
    new = ext.structure.free[len(theta) :]
    full = np.concatenate([theta, [f.scaled(f.start) for f in new]])
    j, a = len(theta), noise.copy()
    values = [new[0].scaled(v) for v in term.effect.starts]
    best, indices = 0, range(0, len(values), 2)
    for _ in range(2):
        loglik = {}
        for i in indices:
            full[j] = values[i]
            loglik[i] = float(ext.loglik(full, a).sum())
        best = max(loglik, key=lambda i: loglik[i])
        indices = range(max(best - NEIGHBOURS, 0), min(best + NEIGHBOURS + 1, len(values)))
        full[j] = values[best]
        for _ in range(NOISE_ROUNDS):
            a, moved = noise_step(ext, full, a, ext.free_noise)
            if moved < NOISE_TOLERANCE:
                break
    return full, a
