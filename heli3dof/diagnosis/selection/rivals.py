"""Two causes whose likelihoods are both biased: each one's flights say what to expect of the other.

Where encoders chatter in the loop the false slopes are large (z̄ of ten), and taken off along a
straight line (`estimate.corrected_maximum`) they decide by themselves which of two terms wins: on a
plain step a lag of 30 ms was called a delay by a score of 600. Cox's test of hypotheses that do
not hold each other (1961), by simulation, needs no line. Every rival k is freed of its bias
(`estimate.bias_correction`), and with the fits held, for the recordings and for B flights of
each rival

    d_jk = ℓ_j − ℓ_k

Under rival k it has mean m_k and standard deviation s_k, and with B − 1 degrees of freedom

    f_k(d) = t_{B−1}((d − m_k)/s_k √(1 + 1/B)) / s_k,        W_kj = 2 ln f_k(d_jk)/f_j(d_jk)

The rival whose least W is largest is the cause; those with W below `TIE` are tied with it, and its
certainty is `certainty` of the least W over the rivals that are not tied with it. Where the false
slopes are small but the score is too (below `MODEST`: a plain step tells little), the scores name
the cause and this is a second opinion: whom it prefers, or cannot tell from that one, is tied with
it.
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
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.parameter_price import price
from heli3dof.diagnosis.selection.select import TIE, Choice, certainty
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

FALSE = 3.0
"""|z̄|, in the nulls' own scatter, from which a slope is no longer taken off along a line."""
NEAR = 0.3
"""Of the largest Z²: below it a term is no rival."""
MODEST = 500.0
CLOSE = 0.25
"""Of the score: below it a term is no rival of one whose false slopes are small."""
MOST = 3
FLIGHTS = 12
ROUNDS = 6
LEAST = 1.0
"""Of s"""


def rivals(choice: Choice, nulls: Nulls) -> tuple[list[CandidateFit], bool]:
    """The choice and those that may be it as well, and whether their false slopes are large.

    None where the scores decide. Only terms that the screen sees: what is only tried has no slope,
    so no false one.
    """
    best = choice.contenders[0]
    seen = [c for c in choice.contenders[1:] if c.probe is not None]
    if best.probe is None or not seen:
        return [], False
    top = max(c.Z2 for c in [best, *seen])
    near = sorted((c for c in seen if NEAR * top < c.Z2), key=lambda c: -c.Z2)[: MOST - 1]
    if near and max(false_slopes(nulls, [best, *near])) > FALSE:
        return [best, *near], True
    close = [c for c in seen if c.score > CLOSE * best.score][: MOST - 1]
    return ([best, *close] if close and best.score < MODEST else []), False


def false_slopes(nulls: Nulls, contenders: Sequence[CandidateFit]) -> list[float]:
    """|z̄|, in the nulls' own scatter, of each that the screen sees."""
    at = [c.probe for c in contenders if c.probe is not None]
    return [float(abs(nulls.mean[i]) / np.sqrt(nulls.inflation)) for i in at]


def compared_by_simulation(
    choice: Choice, nulls: Nulls, recordings: Sequence[Recording], *, seed: int, pilots: int,
    opinions: bool = True,
) -> Choice:  # fmt: skip
    """The choice made again among its rivals by their own flights; as it was where it has none.

    Without ``opinions`` only where the scores cannot decide.
    """
    near, decides = rivals(choice, nulls)
    if not near or not (decides or opinions):
        return choice
    fits = [
        correct(c.problem, c.optimum.theta, c.optimum.noise, recordings, seed=seed, pilots=pilots,
                rounds=ROUNDS)
        for c in near
    ]  # fmt: skip
    W = odds(*likelihoods(fits, recordings, seed=seed))
    k = int(np.argmax(least(W)))
    named = {c.term.name for c in near}
    open_ = [c.term.name for j, c in enumerate(near) if j == k or W[k, j] < TIE]
    if k == 0 or not decides:  # what was tied with it and is no rival still is
        open_ += [n for n in choice.tied_with if n not in named or not decides]
    best = replace(near[k], optimum=fits[k].optimum)
    apart = [W[k, j] for j, c in enumerate(near) if c.term.name not in open_]
    sure = certainty([float(min(apart)), 0.0]) if apart else 1.0
    if decides:
        bought = price(best.problem, best.optimum, best.term.name, nulls.inflation)
        best = replace(best, score=best.Z2 - bought)
    elif k:
        best, sure = near[0], 1.0
    others = [c for c in choice.contenders if c.term.name != best.term.name]
    sure = min(nulls.confidence(best.Z2), sure, 1.0 if decides else choice.confidence)
    tied = tuple(n for n in dict.fromkeys(open_) if n != best.term.name)
    return Choice(
        best.term, best.score, best.Z2, sure, tied, (best, *others), choice.weak, choice.threshold,
        decides,
    )  # fmt: skip


def likelihoods(
    fits: Sequence[CorrectedFit], recordings: Sequence[Recording], *, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """(K,) ℓ of the recordings under each fit, (K, B, K) of the flights of each under each."""
    models = [model_at(f.problem, f.theta, f.optimum.noise) for f in fits]
    data = fits[0].problem.data

    def all_of(b: int) -> np.ndarray:
        here = data
        if b >= 0:
            here = simulate_again(models[b // FLIGHTS], recordings, data, (seed, 13, b % FLIGHTS))
        return np.array([
            float(replace(f.problem, data=here).run(f.theta, f.optimum.noise, keep=0).loglik.sum())
            for f in fits
        ])  # fmt: skip

    flown = parallel_map(all_of, len(fits) * FLIGHTS, what="flights of rivals")
    return all_of(-1), np.array(flown).reshape(len(fits), FLIGHTS, len(fits))


def odds(here: np.ndarray, flown: np.ndarray) -> np.ndarray:
    """(K, K) W_kj from ℓ of the recordings (K,) and of B flights of each rival (K, B, K).

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
            d = here[j] - here[k]
            log_f = []
            for i in (k, j):
                D = flown[i, :, j] - flown[i, :, k]
                s = max(float(D.std(ddof=1)), LEAST) * np.sqrt(1 + 1 / B)
                log_f.append(float(t.logpdf((d - D.mean()) / s, B - 1)) - np.log(s))
            W[k, j] = 2 * (log_f[0] - log_f[1])
            W[j, k] = -W[k, j]
    return W


def least(W: np.ndarray) -> np.ndarray:
    """(K,) the least of W_kj over j ≠ k"""
    return np.asarray(np.where(np.eye(len(W), dtype=bool), np.inf, W).min(axis=1))
