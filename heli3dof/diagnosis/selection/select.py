"""Which causes: screened, fitted, compared; one after another, then each once more without it.

The screen's Z² (calibrated by the nulls) says whether there is anything; full fits of the
likeliest terms say which, on the likelihood freed of its false slopes (`tilted`). With κ the
nulls' inflation

    score = 2 Δℓ_c / κ − price

with ln N for a term's size (BIC; N the encoders' events), and for its other numbers no more than is
told of them (`selection.parameter_price`). Nothing at all scores 0, so what scores less than `TIE`
is tied with it and not named; nor is a term whose own Z² is not beyond the nulls' threshold: what
the screen saw was then another term's. A likelier one that the nulls show as much of does not
refute those that they do not: the likeliest is taken of which the screen saw enough and its full
fit bears that out, by its tie with the likeliest of all or a score beyond the threshold too. It is
tied with all above.

No formula is quite right, and what is wrong with the first cause's looks like a further one: that
must exceed `SHARE` of the first one's score, or `WEAK` where that is less. A term whose trace is
mostly that of the causes found (ρ² > `ALIKE` of what the base leaves of it) has little score of its
own however large it is, and without it the first one's size takes its place: below that floor it is
taken as well, but weakly, "…-like", the formula being as likely wrong. An
inertia that is off (`estimate.base_parameters`) is such a first cause: where the mass that
makes it so sits is not known. Diverged fits and fits on a bound are refused. Terms A and B are tied
where their scores differ by less than

    max(`TIE`, `FORM` score) + 2 √score `DRIFT` |z̄| √(2 (1 − |ρ|))

`TIE` is what chance does to nested neighbours, `FORM` how right any formula of friction, lag or
drag is. The last term is what is left of the false slopes z̄ (the nulls' mean z): they were seen
without the cause and are a little different with it; how much that matters to the choice depends on
how much the two traces differ, ρ being their correlation beside the base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.screening.catalogue import Probe
from heli3dof.diagnosis.screening.grid_trials import GridTrial
from heli3dof.diagnosis.screening.nulls import DRIFT, Nulls
from heli3dof.diagnosis.screening.score_test import Screen, ScreenResult
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, fit_candidates
from heli3dof.model.effects import Term

FITTED = 10
HOPELESS = 0.1
"""Of the largest Z²: below it no term is fitted."""
TIE = 6.0
FORM = 0.03
SHARE = 0.1
WEAK = 100.0
"""Of a score: what a wrong formula leaves for others stays below it."""
ALIKE = 0.5
"""More of what a term does than not is what they do."""
EVEN = 0.5
"""Certainty of one that may as well be what is wrong with another's formula"""
ONE_WAY = 0.25
"""An estimate may go that share of its range below nothing, so as not to be cut off there; a cause
may not."""
LARGE = 5.0
MOST = 4
"""Causes that are looked for, at most."""


@dataclass(frozen=True, eq=False)
class Choice:
    """One step: the term taken, and what it is tied with."""

    term: Term
    score: float
    Z2: float
    confidence: float
    tied_with: tuple[str, ...]
    contenders: tuple[CandidateFit, ...]
    """Best first; the term's own fit is the first one's."""
    weak: bool = False
    """It may as well be what is wrong with an earlier cause's formula."""
    threshold: float = 0.0
    """Of Z², the nulls'"""
    by_flights: bool = False
    """Its rivals' flights chose it (`selection.rivals`), not scores."""


def ranked_candidates(seen: ScreenResult, nulls: Nulls) -> list[tuple[Term, float, int]]:
    """Terms by their best probe's Z², largest first: (term, Z², probe).

    What points the way that a term cannot go (a negative friction, a delay before the command, less
    of a periodic torque than the nulls have) counts as nothing.
    """
    Z = nulls.judged(seen)
    best: dict[str, tuple[Term, float, int]] = {}
    for i, p in enumerate(seen.probes):
        Z2 = float(Z[i]) ** 2 if Z[i] > 0 or not one_sided(p) else 0.0
        if p.name not in best or best[p.name][1] < Z2:
            best[p.name] = (p.term, Z2, i)
    return sorted(best.values(), key=lambda b: -b[1])


def candidates_to_fit(
    suspected: Sequence[tuple[Term, float, int]], screen: Screen, nulls: Nulls, most: int
) -> list[tuple[Term, float, int]]:
    """The first ``most`` of the suspects that recordings tell of, less the hopeless; none where the
    first is not beyond the nulls' threshold."""
    hidden = unidentifiable(screen, nulls)
    ranked = [r for r in suspected if r[0].name not in hidden]
    if not ranked or ranked[0][1] < nulls.threshold:
        return []
    return [r for r in ranked[:most] if r[1] >= HOPELESS * ranked[0][1]]


def one_sided(probe: Probe) -> bool:
    """Whether the term is one that only grows from nothing in the probe's direction."""
    if probe.term.effect.scan or not probe.grows:
        return True
    q = probe.term.effect.parameters[0]
    return q.null - q.low < ONE_WAY * (q.high - q.null)


def choose(
    found: CorrectedFit, screen: Screen, seen: ScreenResult, nulls: Nulls, bias: np.ndarray,
    first_score: float | None, tried: Sequence[GridTrial] = (),
) -> Choice | None:  # fmt: skip
    """The next cause beside those of ``found``; None where nothing more is there.

    ``bias`` (n,): the mean scores of the nulls along the parameters of ``found``; ``tried``: terms
    that no probe sees, and that are worth a fit (`screening.grid_trials`).
    """
    every = ranked_candidates(seen, nulls)
    ranked = candidates_to_fit(every, screen, nulls, FITTED)
    formal = [r for r in every if r[0].effect.formal and nulls.least(r[0]) <= r[1]]
    ranked += [r for r in formal if r not in ranked]
    fits = fit_candidates(found, screen, seen, nulls, bias, ranked, tried)
    return best_choice(found, screen, nulls, fits, first_score)


def best_choice(
    found: CorrectedFit, screen: Screen, nulls: Nulls, fits: Sequence[CandidateFit],
    first_score: float | None,
) -> Choice | None:  # fmt: skip
    """Of contenders beside those of ``found`` the one to be named; None where none is."""
    fits = surest_first(screen, nulls, sorted(fits, key=lambda f: -f.score))
    if not fits or fits[0].score < TIE:
        return None

    def stands(f: CandidateFit) -> bool:
        least = nulls.least(f.term)
        near = fits[0].score - f.score < tie_margin(screen, nulls, fits[0], f)
        return least <= f.Z2 and (near or least <= f.score)

    stand = [i for i, f in enumerate(fits) if stands(f)]
    if not stand:
        return None
    k = stand[0]
    floor = -np.inf if first_score is None else min(SHARE * first_score, WEAK)
    weak = fits[k].score < floor and not fits[k].term.effect.formal
    if weak and not resembles_found_causes(found, screen, fits[k]):
        # No cause; but how the body's equations are written is none anyway.
        k, weak = next((i for i in stand if fits[i].term.effect.formal), -1), False
        if k < 0:
            return None
    above, best, below = fits[:k], fits[k], fits[k + 1 :]
    fits = [best, *above, *below]
    close = [f for f in below if best.score - f.score < tie_margin(screen, nulls, best, f)]
    tied = tuple(f.term.name for f in (*above, *close))
    # Of the best or one of those tied with it, against the best of the others.
    second = [f.score for f in below if f not in close][:1]
    sure = min(nulls.confidence(best.Z2), certainty([best.score, *second, 0.0]))
    if weak:
        sure = min(sure, EVEN)
    return Choice(best.term, best.score, best.Z2, sure, tied, tuple(fits), weak, nulls.threshold)


def resembles_found_causes(found: CorrectedFit, screen: Screen, new: CandidateFit) -> bool:
    """Whether the causes found move the rig mostly as the new one does."""
    causes = np.array([f.term is not None for f in found.free])
    return new.probe is not None and screen.shared(new.probe, causes) > ALIKE


def certainty(scores: Sequence[float]) -> float:
    """The chance of the first of the scores against the second, both as likely before.

    Scores are 2 ln L, so it is 1/(1 + exp(−Δ/2)) of their difference.

    >>> round(this_one([20.0, 20.0]), 2), round(this_one([26.0, 20.0]), 2)
    (0.5, 0.95)
    """
    if len(scores) < 2:
        return 1.0
    return float(1 / (1 + np.exp(-min(scores[0] - scores[1], 200.0) / 2)))


def surest_first(screen: Screen, nulls: Nulls, fits: Sequence[CandidateFit]) -> list[CandidateFit]:
    """Best first; of those tied with the best, what every rig has and a simpler base lacks is."""
    near = [f for f in fits if fits[0].score - f.score < tie_margin(screen, nulls, fits[0], f)]
    return sorted(fits, key=lambda f: not (f in near and f.term.effect.missing))


def tie_margin(screen: Screen, nulls: Nulls, best: CandidateFit, other: CandidateFit) -> float:
    """Within how much of the best one's score another is tied with it; see the module."""
    plain = max(TIE, FORM * best.score)
    a, b = best.probe, other.probe
    if a is None or b is None or max(a, b) >= len(screen.plain):
        return plain
    drift = DRIFT * max(abs(nulls.mean[a]), abs(nulls.mean[b])) / np.sqrt(nulls.inflation)
    apart = np.sqrt(2 * (1 - min(abs(screen.correlation(a, b)), 1.0)))
    return float(plain + 2 * np.sqrt(max(best.score, 0.0)) * drift * apart)


def unidentifiable(screen: Screen, nulls: Nulls) -> tuple[str, ...]:
    """Terms of which even a large size (`LARGE` × typical) stays below 3 σ in these recordings.

    A number that is found for one of them is one that a rig cannot have. The nearest to being told
    stands first: another flight tells of it soonest.
    """
    sigma = _sigma(screen, nulls)
    best: dict[str, float] = {}
    for p, s, v in zip(screen.plain, sigma, screen.v, strict=True):
        share = 3 * float(s) / (LARGE * p.term.effect.parameters[0].typical)
        if not p.grows:  # a limit: it is seen where it was reached
            share = 0.0 if np.isfinite(v) else np.inf
        best[p.name] = min(best.get(p.name, np.inf), share)
    return tuple(sorted((n for n, share in best.items() if share > 1), key=lambda n: best[n]))


def _sigma(screen: Screen, nulls: Nulls) -> np.ndarray:
    """(plain probes,) standard deviations of the first parameters, in their units."""
    v = np.maximum(screen.information(), 1e-300)
    return np.asarray(nulls.std[: len(screen.plain)] / np.sqrt(v))


def least_found(screen: Screen, nulls: Nulls, name: str) -> float:
    """The size of a term's first parameter, in its unit, at which its Z² reaches the threshold."""
    sigma = _sigma(screen, nulls)
    named = [float(s) for p, s in zip(screen.plain, sigma, strict=True) if p.name == name]
    return float(np.sqrt(nulls.threshold)) * min(named, default=np.inf)
