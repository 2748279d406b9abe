"""Choose the next cause in a forward selection of effects, by score tests and refits.

A forward selection adds one cause to the model in each step. The candidates are the effects that
the current model lacks. A step uses two statistics of each candidate:

- Z² is the standardised statistic of its score test (`search.screening`). A large Z² shows that
  some effect is present.
- S, called the *score*, is the gain in BIC if the model is refitted with the candidate added
  (`search.candidate_fits`). It shows which candidate is the cause. The log-likelihood in BIC is
  corrected for bias. The current model has S = 0.

**Confounded candidates.** Two candidates with the scores S > S′ are confounded (`are_confounded`)
if

    min(S − S′, (1 − ρ²) S) < max(`TIE`, `FORMULA_ERROR` · S) + 2 √S ε √(2 (1 − |ρ|))
    ε² = (`DRIFT` z̄)²/κ + 1/B

ρ is a correlation (`Screen.correlation`). Each of the two candidates changes the predicted encoder
readings, and ρ is the correlation of these changes. If the first candidate is the cause, the second
one is expected to explain the share ρ² of S. So the expected value of S − S′ is (1 − ρ²) S. If
S − S′ is larger, the excess is due to chance or to an inexact formula of an effect. The excess is
no evidence against the second candidate, so the criterion uses the smaller of the two numbers.

The last term of the criterion is the standard deviation of S − S′ due to ε. ε is the uncertainty of
the bias correction, which comes from B null simulations: flights simulated from the current model,
without any candidate (`search.nulls`).

- z: statistic of the score test before it is standardised; mean 0 and variance 1 if the likelihood
  is exact
- z̄: mean of z over the null simulations. The candidate with the larger |z̄| counts
- κ: variance of z over the null simulations, at least 1 (median over all candidates)
- `DRIFT`: assumed relative error of z̄

A candidate may have no score test, or one that is a maximum over all frequencies or start times. If
one of the two candidates is of this kind, ρ and ε count as 0.

**Choice.** `best_choice` applies these rules:

1. If the best score is below `TIE`, no effect is a cause.
2. A candidate qualifies if its Z² reaches the threshold of its score test (`Nulls.threshold_of`).
   In addition, S must reach the same threshold, or the candidate must be confounded with the
   candidate of the best score.
3. The qualified candidate with the highest score is chosen. Candidates with still higher scores did
   not qualify: their scores may be bias. They are reported as confounded with the chosen one.
4. The error of an earlier cause's formula may resemble a further cause. So a further cause needs a
   score of at least min(`MIN_FURTHER_SCORE` · largest earlier score, `SUFFICIENT`). An inertia off
   nominal counts as an earlier cause. It often comes from an additional mass on the rig. The
   position of this mass is unknown, so the formula of the inertia is inexact, too. ``formal``
   effects, which only change the form of the rigid body's equations, are exempt from this rule.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from heli3dof.diagnosis.base_parameters import OffNominal
from heli3dof.diagnosis.constants import DRIFT, SUFFICIENT, TIE
from heli3dof.diagnosis.search.candidate_fits import (
    CandidateFit,
    GridTrial,
    fit_candidates,
)
from heli3dof.diagnosis.search.screening import Screening
from heli3dof.model.effects import Term

MAX_FITS = 10
"""Largest number of terms with a score test that are refitted per step. Chosen; not derived."""
FORMULA_ERROR = 0.03
"""Relative error of a score caused by an inexact formula of an effect. Chosen; not derived."""
MIN_FITTED_Z2 = 0.1
"""Least Z² of a term for a refit, relative to the largest Z². Chosen; not derived."""
MIN_FURTHER_SCORE = 0.1
"""Least score of a further cause, relative to the largest earlier score. Chosen; not derived."""


@dataclass(frozen=True, eq=False)
class Choice:
    """The cause chosen in a step, and the causes confounded with it."""

    term: Term
    score: float
    confidence: float
    tied_with: tuple[str, ...]
    candidates: tuple[CandidateFit, ...]
    """All fitted candidates: the chosen one, then the others, best first"""
    threshold: float = 0.0
    """Threshold of Z², from null simulations (`search.nulls`)"""
    by_flights: bool = False
    """True if simulated flights of rivals (`search.rivals`), not scores, decided the choice"""
    within_bias_error: bool = False
    """True if a cause is confounded with the chosen one only because of ε (see the module)"""


Cause = TypeVar("Cause", Choice, OffNominal)


def with_ties(cause: Cause, names: Iterable[str]) -> Cause:
    """Return the cause; its ``tied_with`` also contains ``names``, each name once."""
    return replace(cause, tied_with=tuple(dict.fromkeys((*cause.tied_with, *names))))


def choose(
    s: Screening, earlier_score: float | None, tried: Sequence[GridTrial] = ()
) -> Choice | None:
    """Return the next cause to add to the fit ``s.fit``; None if there is none.

    ``s`` contains Z² of each candidate term, the statistic of its score test. The function refits
    the model several times, each time with one term added. It adds the terms with a large Z², and
    those in ``tried``. ``tried`` contains terms that the score test cannot detect (backlash). The
    refits' scores, their gains in BIC, determine the cause. ``earlier_score``: largest score of the
    earlier causes, None without an earlier cause.
    """
    ranked = candidates_to_fit(s)
    formal = [r for r in s.ranked if r[0].effect.formal and s.nulls.threshold_of(r[0]) <= r[1]]
    ranked += [r for r in formal if r not in ranked]
    return best_choice(s, fit_candidates(s, ranked, tried), earlier_score)


def candidates_to_fit(s: Screening) -> list[tuple[Term, float, int]]:
    """Return at most `MAX_FITS` terms to refit; none if no Z² reaches `Nulls.threshold`.

    Each element is an entry of `Screening.ranked`.
    """
    if not s.ranked or s.ranked[0][1] < s.nulls.threshold:
        return []
    return [r for r in s.ranked[:MAX_FITS] if r[1] >= MIN_FITTED_Z2 * s.ranked[0][1]]


def best_choice(
    s: Screening, fits: Sequence[CandidateFit], earlier_score: float | None
) -> Choice | None:
    """Return the best cause among the ``fits`` by the module's rules 1 to 4, or None.

    ``earlier_score``: largest score of the earlier causes, None without an earlier cause.
    """
    nulls = s.nulls
    fits = sorted(fits, key=lambda f: -f.score)
    if not fits or fits[0].score < TIE:
        return None

    def qualifies(f: CandidateFit) -> bool:
        least = nulls.threshold_of(f.term)
        return least <= f.statistic and (least <= f.score or are_confounded(s, fits[0], f))

    qualified = [i for i, f in enumerate(fits) if qualifies(f)]
    if not qualified:
        return None
    k = qualified[0]
    floor = -np.inf if earlier_score is None else min(MIN_FURTHER_SCORE * earlier_score, SUFFICIENT)
    if fits[k].score < floor:
        formal = [i for i in qualified if fits[i].term.effect.formal]
        if not formal:
            return None
        k = formal[0]
    above, best, below = fits[:k], fits[k], fits[k + 1 :]
    fits = [best, *above, *below]
    close = [f for f in below if are_confounded(s, best, f)]
    confounded = tuple(f.term.name for f in (*above, *close))
    # The probability that the cause is the chosen one or one confounded with it.
    apart = [f.score for f in below if f not in close]
    probability = min(nulls.confidence(best.statistic), certainty([best.score, *apart, 0.0]))
    return Choice(
        best.term, best.score, probability, confounded, tuple(fits), nulls.threshold,
        within_bias_error=any(not are_confounded(s, best, f, bias_error=False) for f in close),
    )  # fmt: skip


def certainty(scores: Sequence[float]) -> float:
    """Return the posterior probability of the first of several models, with equal priors.

    ``scores``: S = 2 ln L of the models. The probability is exp(S_0/2)/Σ exp(S_i/2).

    >>> round(certainty([20.0, 20.0]), 2), round(certainty([26.0, 20.0]), 2)
    (0.5, 0.95)
    """
    from scipy.special import softmax

    return float(softmax(np.array(scores) / 2)[0])


def least_difference(score: float) -> float:
    """Return the least difference of two candidates' scores that counts as evidence.

    A smaller difference may be due to chance, or to an inexact formula of an effect. ``score`` is
    the higher of the two scores. The error of the bias correction is not included.
    """
    return max(TIE, FORMULA_ERROR * score)


def are_confounded(
    s: Screening, best: CandidateFit, other: CandidateFit, *, bias_error: bool = True
) -> bool:
    """Return whether the recordings cannot distinguish two candidates (see the module).

    ``best``: the candidate with the higher score. The function allows for the uncertainty ε of the
    bias correction. If ``bias_error`` is False, it sets ε = 0.
    """
    difference, score = best.score - other.score, max(best.score, 0.0)
    margin = least_difference(score)
    a, b = best.probe, other.probe
    if a is not None and b is not None and max(a, b) < len(s.screen.plain):
        rho, nulls = min(abs(s.screen.correlation(a, b)), 1.0), s.nulls
        difference = min(difference, (1 - rho**2) * score)
        drift = DRIFT * max(abs(nulls.mean[a]), abs(nulls.mean[b])) / np.sqrt(nulls.inflation)
        error = np.hypot(drift, nulls.flights**-0.5 if nulls.flights else 0.0)
        margin += bias_error * 2 * np.sqrt(score) * error * np.sqrt(2 * (1 - rho))
    return bool(difference < margin)
