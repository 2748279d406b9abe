"""Compare causes by flights simulated from each: Cox's test of separate hypotheses (1961).

Usually, the search chooses the candidate cause with the best score (`search.select`). The score is
the gain in BIC. The likelihood is approximate, so the score contains a linear correction for bias
(`bias_correction.corrected_maximum`). The bias is estimated from null simulations: flights
simulated from the current model, without any of the candidates (`search.nulls`).

- z: score-test statistic of a candidate; mean 0 and variance 1 if the likelihood is exact
- z̄: mean of z over the null simulations
- κ: variance of z over the null simulations, at least 1 (median over all candidates)

Cox's test does not use the linear correction. The candidates that it compares are called rivals.
The test decides in place of the scores in two cases:

1. The bias of a rival is too large for a linear correction: |z̄|/√κ > `SIGMAS_997`. An encoder limit
   cycle causes such a bias.
2. Rivals are confounded only because of ε, the uncertainty of the linear correction
   (`search.select`). The number of null simulations is small, so z̄ and ε depend on their random
   seed. If the scores decided this case, the seed might determine whether rivals are reported as
   confounded.

Each rival is fitted (`bias_correction.correction`), and B flights are simulated from each fit. For
the rivals j and k, d_jk = ℓ_j − ℓ_k is the difference of their log-likelihoods for the recordings.
In the flights simulated from k, the same difference has the mean m_k and the standard deviation
s_k. So the flights give f_k, the probability density of d_jk if k is the cause. In the same way,
the flights simulated from j give f_j. t is the density of Student's distribution with B − 1 degrees
of freedom:

    f_k(d) = t((d − m_k)/(s_k √(1 + 1/B))) / s_k,      W_kj = 2 ln [f_k(d_jk)/f_j(d_jk)]

W_kj is twice the log odds of k against j. The chosen cause is the rival k with the largest
min_{j≠k} W_kj. Rivals j with W_kj < `TIE` are confounded with k. The confidence in k is at most its
posterior probability (`select.certainty`). This probability compares k only with the rivals that
are not confounded with it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.constants import FALSE_ALARMS, MAX_COMPARED, SIGMAS_997, TIE
from heli3dof.diagnosis.search.candidate_fits import (
    CandidateFit,
    bic_penalty,
    correction_starts,
)
from heli3dof.diagnosis.search.nulls import Nulls
from heli3dof.diagnosis.search.select import Choice, certainty
from heli3dof.distributions import t_isf, t_logpdf
from heli3dof.identification.bias_correction.correction import (
    CorrectedFit,
    correct,
    model_at,
    simulate_again,
)
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording

MIN_RELATIVE_Z2 = 0.3
"""A candidate is compared only if its Z² is this share of the largest Z². Chosen; not derived."""
FLIGHTS, ROUNDS = 12, 6
"""B, flights simulated from each rival; rounds of its bias correction. Chosen; not derived."""
MIN_STD = 1.0
"""Least standard deviation s_k of a log-likelihood difference. Chosen; not derived."""


def rivals(choice: Choice, nulls: Nulls) -> list[CandidateFit]:
    """Return the candidates to compare by simulated flights, the chosen cause first.

    The result is empty if no comparison is needed: usually the candidates' BIC scores decide which
    one is the cause. The scores are unreliable in two cases:

    - The score test is strongly biased for one of the candidates: `relative_bias` exceeds
      `SIGMAS_997`.
    - Candidates are confounded only because the correction of this bias is uncertain.

    In these cases, the result contains the chosen cause and at most `MAX_COMPARED` − 1 others. The
    others are those with the largest Z², the statistic of the score test. A candidate without a
    score test (encoder backlash) is omitted. If the chosen cause has no score test, the result is
    empty.
    """
    best = choice.candidates[0]
    others = [c for c in choice.candidates[1:] if c.probe is not None]
    if best.probe is None or not others:
        return []
    least = MIN_RELATIVE_Z2 * max(c.statistic for c in [best, *others])
    close = sorted((c for c in others if least < c.statistic), key=lambda c: -c.statistic)
    compared = [best, *close[: MAX_COMPARED - 1]]
    is_biased = any(bias > SIGMAS_997 for bias in relative_bias(nulls, compared))
    return compared if close and (is_biased or choice.within_bias_error) else []


def relative_bias(nulls: Nulls, candidates: Sequence[CandidateFit]) -> list[float]:
    """Return |z̄|/√κ, the bias of the score test relative to its scatter, for each candidate.

    z̄ is the mean of the candidate's score-test statistic z over the null simulations: flights
    simulated without any of the candidates. κ is the variance of z in these simulations, at least 1
    (median over all candidates). Candidates without a score test are omitted. Candidates whose z is
    a maximum over frequencies or start times are also omitted: such a z has a positive mean even
    without bias.
    """
    at = [c.probe for c in candidates if c.probe is not None and not c.term.effect.scan]
    return [float(abs(nulls.mean[i]) / np.sqrt(nulls.inflation)) for i in at]


def compared_by_simulation(
    choice: Choice, current: CorrectedFit, nulls: Nulls, recordings: Sequence[Recording], *,
    seed: int, flights_per_round: int,
) -> Choice:  # fmt: skip
    """Return the choice of a cause, revised by simulated flights if scores cannot rank the rivals.

    The rivals are the candidates that `rivals` returns. ``current``: the fit to which the cause is
    added. ``flights_per_round``: flights that each round of the bias correction simulates. A rival
    whose bias correction diverges cannot be simulated, so it is not the cause.
    """
    compared = rivals(choice, nulls)
    fits = [
        correct(c.problem, correction_starts(c.optimum, current), recordings, seed=seed,
                flights_per_round=flights_per_round, rounds=ROUNDS)
        for c in compared
    ]  # fmt: skip
    simulated = [k for k, f in enumerate(fits) if f.is_corrected]
    if not simulated:
        return choice
    W = np.full((len(fits), len(fits)), -np.inf)
    W[simulated] = np.inf
    W[np.ix_(simulated, simulated)] = odds(
        *likelihoods([fits[k] for k in simulated], recordings, seed=seed)
    )
    k = int(np.argmax(least_odds(W)))
    best = replace(compared[k], optimum=fits[k].optimum)
    m = sum(f.term == best.term.name for f in best.problem.structure.free)
    best = replace(best, score=best.statistic - bic_penalty(m, best.optimum.at))
    refuted = [j for j in range(len(compared)) if j != k and W[k, j] >= TIE]
    certain = certainty([0.0, *(-W[k, refuted])])
    names = [c.term.name for c in compared]
    tied = [n for j, n in enumerate(names) if j not in (k, *refuted)]
    if k == 0:  # causes that were not compared remain confounded with it
        tied += [n for n in choice.tied_with if n not in names]
    others = [c for c in choice.candidates if c.term.name != best.term.name]
    return Choice(
        best.term, best.score, min(nulls.confidence(best.statistic), certain), tuple(tied),
        (best, *others), choice.threshold, by_flights=True,
    )  # fmt: skip


def likelihoods(
    fits: Sequence[CorrectedFit], recordings: Sequence[Recording], *, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the log-likelihoods of K fits for the recordings (K,) and for simulated flights.

    The second array is (K, B, K): B flights are simulated from each fit (first axis), and the
    likelihood of each fit (last axis) is evaluated for each flight.
    """
    models = [model_at(f.problem, f.theta, f.optimum.noise) for f in fits]
    data = fits[0].problem.data

    def all_fits(b: int) -> np.ndarray:
        d = data
        if b >= 0:
            d = simulate_again(models[b // FLIGHTS], recordings, data, (seed, 13, b % FLIGHTS))
        return np.array([
            float(replace(f.problem, data=d).loglik(f.theta, f.optimum.noise).sum())
            for f in fits
        ])  # fmt: skip

    flown = replicate(all_fits, len(fits) * FLIGHTS, what="flights of rivals")
    return all_fits(-1), np.array(flown).reshape(len(fits), FLIGHTS, len(fits))


def is_refuted(recorded: np.ndarray, flown: np.ndarray, k: int, j: int) -> bool:
    """Return whether flights simulated from rival k refute that k is the cause, in favour of j.

    Rivals k and j are two fits, each with another cause. d = ℓ_j − ℓ_k is the difference of their
    log-likelihoods for a flight. Let m_k be the mean of d over the flights simulated from k, and
    m_j the mean over those simulated from j. Rival k is refuted if d of the recordings deviates
    from m_k, in the direction of m_j, by more than chance allows. If k were the cause, a deviation
    this large would have at most the probability `FALSE_ALARMS`.

    In the same way, the flights simulated from j may refute j; then neither rival is the whole
    cause.
    ``recorded``, ``flown``: as in `odds`.

    >>> flown = np.zeros((2, 4, 2))
    >>> flown[0, :, 0], flown[1, :, 1] = [9, 10, 10, 11], [9, 10, 10, 11]
    >>> is_refuted(np.array([10.0, 0.0]), flown, 1, 0)
    True
    >>> is_refuted(np.array([10.0, 0.0]), flown, 0, 1)
    False
    """
    of_k, of_j = (flown[i, :, j] - flown[i, :, k] for i in (k, j))
    z, _ = _standardised(recorded[j] - recorded[k], of_k)
    towards_j = np.sign(of_j.mean() - of_k.mean())
    return bool(z * towards_j > t_isf(FALSE_ALARMS, len(of_k) - 1))


def _standardised(recorded_d: float, flown_d: np.ndarray) -> tuple[float, float]:
    """Return (z, s) with z = (d − mean)/s, for the difference d of two rivals' log-likelihoods.

    d is ``recorded_d`` for the recordings and ``flown_d`` (B,) for B flights simulated from one
    rival. The mean is over these flights. s is the standard deviation of d − mean if this rival is
    the cause; z then has Student's distribution with B − 1 degrees of freedom.
    """
    s = max(float(flown_d.std(ddof=1)), MIN_STD) * np.sqrt(1 + 1 / len(flown_d))
    return float((recorded_d - flown_d.mean()) / s), float(s)


def odds(recorded: np.ndarray, flown: np.ndarray) -> np.ndarray:
    """Return W (K, K): W_kj is twice the log odds of rival k against j, positive if k is likelier.

    The K rivals are fits, each with another cause. ``recorded`` (K,): log-likelihood of each rival
    for the recordings. ``flown[i, b, k]``: log-likelihood of rival k for flight b of the B flights
    simulated from rival i.

    Let d = ℓ_j − ℓ_k be the difference of two rivals' log-likelihoods. The flights simulated from k
    give the probability density f_k of d, those simulated from j the density f_j. The odds are
    f_k/f_j at the value of d for the recordings.

    >>> flown = np.zeros((2, 4, 2))
    >>> flown[0, :, 0], flown[1, :, 1] = [9, 10, 10, 11], [9, 10, 10, 11]
    >>> bool(odds(np.array([10.0, 0.0]), flown)[0, 1] > 10)
    True
    """
    K, B, _ = flown.shape
    W = np.zeros((K, K))
    for k in range(K):
        for j in range(k):
            d = recorded[j] - recorded[k]
            log_f = []
            for i in (k, j):
                z, s = _standardised(d, flown[i, :, j] - flown[i, :, k])
                log_f.append(float(t_logpdf(z, B - 1)) - np.log(s))
            W[k, j] = 2 * (log_f[0] - log_f[1])
            W[j, k] = -W[k, j]
    return W


def least_odds(W: np.ndarray) -> np.ndarray:
    """Return min_{j≠k} W_kj (K,): twice each rival k's log odds against its strongest opponent j.

    ``W`` (K, K): twice the log odds of rival k (row) against rival j (column).
    """
    return np.asarray(np.where(np.eye(len(W), dtype=bool), np.inf, W).min(axis=1))
