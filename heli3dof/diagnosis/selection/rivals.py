"""Compare two causes by flights simulated from each: Cox's test of separate hypotheses (1961).

Encoders on a limit cycle make the score bias large, and its linear correction
(`estimate.corrected_maximum`) too inaccurate to rank causes. This test needs no such correction.
Each rival k is fitted (`estimate.bias_correction`). The recordings, and B flights simulated from
each rival, give differences of log-likelihoods d_jk = ℓ_j − ℓ_k. Under rival k they have mean m_k
and standard deviation s_k. With Student's density t of B − 1 degrees of freedom,

    f_k(d) = t_{B−1}((d − m_k)/(s_k √(1 + 1/B))) / s_k,      W_kj = 2 ln f_k(d_jk)/f_j(d_jk)

1. **Large score bias** (|z̄|/√κ > `LARGE_BIAS`, with the nulls' mean score z̄ and inflation κ): the
   rival k with the largest min_j W_kj is the cause. Rivals j with W_kj < `TIE` are confounded with
   it. Its probability is `certainty` of the smallest W_kj of the remaining rivals.
2. **Small score bias, score below `SUFFICIENT_SCORE`**: the scores choose the cause. The rival that
   this test prefers is confounded with that cause. So are the rivals that the test does not
   separate from the preferred one (W < `TIE`).
3. **Otherwise** the scores decide and nothing is simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import (
    CorrectedFit,
    correct,
    model_at,
    simulate_again,
)
from heli3dof.diagnosis.screening.nulls import Nulls
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, bic_penalty
from heli3dof.diagnosis.selection.select import TIE, Choice, certainty
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording

LARGE_BIAS = 3.0
"""|z̄|/√κ above which the linear bias correction is not trusted. Chosen; not derived."""
MIN_RELATIVE_Z2 = 0.3
"""Least Z² of a rival, relative to the largest, if the bias is large. Chosen; not derived."""
SUFFICIENT_SCORE = 500.0
"""Score from which on a small bias needs no comparison. Chosen; not derived."""
MIN_RELATIVE_SCORE = 0.25
"""Least score of a rival, relative to the best, if the bias is small. Chosen; not derived."""
MAX_RIVALS = 3
"""Rivals compared, the chosen cause included. Chosen; not derived."""
FLIGHTS, ROUNDS = 12, 6
"""B, flights simulated from each rival; rounds of its bias correction. Chosen; not derived."""
MIN_STD = 1.0
"""Least s_k. Chosen; not derived."""


def rivals(choice: Choice, nulls: Nulls) -> tuple[list[CandidateFit], bool]:
    """Return the candidates that scores cannot rank, and whether their score bias is large.

    The chosen cause is the first of them. If there are none, the scores decide. Terms without a
    score have no score bias and are not among them.
    """
    best = choice.candidates[0]
    others = [c for c in choice.candidates[1:] if c.probe is not None]
    if best.probe is None or not others:
        return [], False
    top = max(c.Z2 for c in [best, *others])
    by_Z2 = sorted((c for c in others if MIN_RELATIVE_Z2 * top < c.Z2), key=lambda c: -c.Z2)[
        : MAX_RIVALS - 1
    ]
    if by_Z2 and max(relative_bias(nulls, [best, *by_Z2])) > LARGE_BIAS:
        return [best, *by_Z2], True
    by_score = [c for c in others if c.score > MIN_RELATIVE_SCORE * best.score][: MAX_RIVALS - 1]
    return ([best, *by_score] if by_score and best.score < SUFFICIENT_SCORE else []), False


def relative_bias(nulls: Nulls, candidates: Sequence[CandidateFit]) -> list[float]:
    """Return |z̄|/√κ, the bias of the score over its scatter, of each candidate with a score."""
    at = [c.probe for c in candidates if c.probe is not None]
    return [float(abs(nulls.mean[i]) / np.sqrt(nulls.inflation)) for i in at]


def compared_by_simulation(
    choice: Choice, nulls: Nulls, recordings: Sequence[Recording], *, seed: int, pilots: int,
    test_small_bias: bool = True,
) -> Choice:  # fmt: skip
    """Return the choice, revised by flights simulated from each rival (module, rules 1 and 2).

    ``pilots``: simulated flights of a bias correction. ``test_small_bias``: also apply rule 2.
    """
    compared, decides = rivals(choice, nulls)
    if not compared or not (decides or test_small_bias):
        return choice
    fits = [
        correct(c.problem, c.optimum.theta, c.optimum.noise, recordings, seed=seed, pilots=pilots,
                rounds=ROUNDS)
        for c in compared
    ]  # fmt: skip
    W = odds(*likelihoods(fits, recordings, seed=seed))
    k = int(np.argmax(least_odds(W)))
    names = {c.term.name for c in compared}
    confounded = [c.term.name for j, c in enumerate(compared) if j == k or W[k, j] < TIE]
    if k == 0 or not decides:  # causes that were confounded with it but not compared still are
        confounded += [n for n in choice.tied_with if n not in names or not decides]
    best = replace(compared[k], optimum=fits[k].optimum)
    refuted = [W[k, j] for j, c in enumerate(compared) if c.term.name not in confounded]
    probability = certainty([float(min(refuted)), 0.0]) if refuted else 1.0
    if decides:
        m = sum(f.term == best.term.name for f in best.problem.structure.free)
        best = replace(best, score=best.Z2 - bic_penalty(m, best.optimum.at))
    elif k:
        best, probability = compared[0], 1.0
    others = [c for c in choice.candidates if c.term.name != best.term.name]
    probability = min(nulls.confidence(best.Z2), probability, 1.0 if decides else choice.confidence)
    tied = tuple(n for n in dict.fromkeys(confounded) if n != best.term.name)
    return Choice(
        best.term, best.score, best.Z2, probability, tied, (best, *others),
        choice.threshold, decides,
    )  # fmt: skip


def likelihoods(
    fits: Sequence[CorrectedFit], recordings: Sequence[Recording], *, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the log-likelihoods of the recordings (K,) and of B flights from each fit (K, B, K).

    The last axis is the fit whose likelihood is evaluated.
    """
    models = [model_at(f.problem, f.theta, f.optimum.noise) for f in fits]
    data = fits[0].problem.data

    def all_fits(b: int) -> np.ndarray:
        d = data
        if b >= 0:
            d = simulate_again(models[b // FLIGHTS], recordings, data, (seed, 13, b % FLIGHTS))
        return np.array([
            float(replace(f.problem, data=d).run(f.theta, f.optimum.noise, keep=0).loglik.sum())
            for f in fits
        ])  # fmt: skip

    flown = replicate(all_fits, len(fits) * FLIGHTS, what="flights of rivals")
    return all_fits(-1), np.array(flown).reshape(len(fits), FLIGHTS, len(fits))


def odds(recorded: np.ndarray, flown: np.ndarray) -> np.ndarray:
    """Return W_kj (K, K), twice the log odds of rivals k and j, from the results of `likelihoods`.

    >>> flown = np.zeros((2, 4, 2))
    >>> flown[0, :, 0], flown[1, :, 1] = [9, 10, 10, 11], [9, 10, 10, 11]
    >>> bool(odds(np.array([10.0, 0.0]), flown)[0, 1] > 10)
    True
    """
    from scipy.stats import t

    K, B, _ = flown.shape
    W = np.zeros((K, K))
    for k in range(K):
        for j in range(k):
            d = recorded[j] - recorded[k]
            log_f = []
            for i in (k, j):
                D = flown[i, :, j] - flown[i, :, k]
                s = max(float(D.std(ddof=1)), MIN_STD) * np.sqrt(1 + 1 / B)
                log_f.append(float(t.logpdf((d - D.mean()) / s, B - 1)) - np.log(s))
            W[k, j] = 2 * (log_f[0] - log_f[1])
            W[j, k] = -W[k, j]
    return W


def least_odds(W: np.ndarray) -> np.ndarray:
    """Return the smallest W_kj over j ≠ k, for each k (K,)."""
    return np.asarray(np.where(np.eye(len(W), dtype=bool), np.inf, W).min(axis=1))
