"""Choose among confounded causes the one that explains most together with a further cause.

A rotor curve and a thrust curve explain a curved thrust equally well. If the supply also sags, the
wrong one of them absorbs the sag and so hides it. Therefore each confounded cause j is added to the
base, and further terms u are screened and fitted. With BIC scores S (`selection.select`),

    J_j = S_j + max(0, max_u S_{u|j})

1. Cause j replaces the chosen cause if its J is higher by more than `TIE`.
2. A term u counts only if its Z² reaches the threshold of the step's nulls, which are reused.
3. If the score bias is large (`selection.rivals`), scores cannot be compared: nothing changes.
4. A pair (j, u) may imitate one single cause. So its W of `selection.rivals` must reach
   `MIN_PAIR_W` against each confounded cause without a companion. Otherwise the most likely of
   these is taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit, correct
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.screening.nulls import Nulls
from heli3dof.diagnosis.screening.score_test import Screen
from heli3dof.diagnosis.selection.alternatives import MAX_ALTERNATIVES, instead
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, fit_candidates
from heli3dof.diagnosis.selection.rivals import (
    LARGE_BIAS,
    ROUNDS,
    likelihoods,
    odds,
    relative_bias,
)
from heli3dof.diagnosis.selection.select import TIE, Choice, candidates_to_fit, ranked_candidates
from heli3dof.diagnosis.selection.steps import Step, extended, screened

MAX_COMPANIONS = 4
"""Most further terms fitted with each confounded cause. Chosen; not derived."""
MIN_PAIR_W = 12.0
"""Least W of a pair over a single cause: 2 `TIE`, since the pair is the best of many. Chosen."""


def comparable(step: Step) -> list[CandidateFit]:
    """Return the chosen cause and those confounded with it, if their scores are comparable.

    Otherwise return the chosen cause only. This is the case if a bias is large, if a score is
    missing, or if the chosen cause is a part of the full equations that the base lacks.
    """
    choice = step.choice
    assert choice is not None
    best = choice.contenders[0]
    confounded = [c for c in choice.contenders[1:] if c.term.name in choice.tied_with]
    each = [best, *confounded[: MAX_ALTERNATIVES - 1]]
    bias = relative_bias(step.nulls, each)
    screened_only = len(bias) == len(each) and not best.term.effect.within
    return each if screened_only and max(bias) <= LARGE_BIAS else each[:1]


def companion(step: Step, setup: Setup, fit: CorrectedFit) -> CandidateFit | None:
    """Return the most likely further term of ``fit`` beyond the threshold, if any."""
    screen, result = screened(setup, fit)
    nulls = nulls_for(step, screen)
    ranked = candidates_to_fit(ranked_candidates(result, nulls), screen, nulls, MAX_COMPANIONS)
    bias = np.zeros(len(fit.theta)) if fit.bias is None else fit.bias
    fits = fit_candidates(fit, screen, result, nulls, bias, ranked)
    return next((f for f in fits if nulls.threshold <= f.Z2), None)


def single_cause(
    setup: Setup, pair: CandidateFit, single: Sequence[tuple[CandidateFit, CorrectedFit]]
) -> CandidateFit | None:
    """Return the most likely ``single`` cause that the pair does not beat, if any."""
    if not single:
        return None
    both = correct(
        pair.problem, pair.optimum.theta, pair.optimum.noise, setup.recordings,
        seed=setup.seed, pilots=setup.pilots, rounds=ROUNDS,
    )  # fmt: skip
    W = odds(*likelihoods([both, *(f for _, f in single)], setup.recordings, seed=setup.seed))
    unbeaten = [k for k in range(1, len(W)) if W[0, k] < MIN_PAIR_W]
    return single[min(unbeaten, key=lambda k: W[0, k]) - 1][0] if unbeaten else None


def nulls_for(step: Step, screen: Screen) -> Nulls:
    """Return the step's nulls in the order of another screen's probes; N(0, κ) for new probes."""
    index = {(p.name, p.values): i for i, p in enumerate(step.screen.plain)}
    first = len(step.screen.plain)
    index |= {(s.term.name, ()): first + k for k, s in enumerate(step.screen.scans)}
    keys = [(p.name, p.values) for p in screen.plain] + [(s.term.name, ()) for s in screen.scans]
    at = [index.get(k) for k in keys]
    n = step.nulls
    root = float(np.sqrt(n.inflation))
    mean = np.array([0.0 if i is None else n.mean[i] for i in at])
    std = np.array([root if i is None else n.std[i] for i in at])
    return replace(n, mean=mean, std=std)


def best_with_companion(setup: Setup, step: Step) -> tuple[Choice, dict[str, CorrectedFit]]:
    """Return the choice by the module's rules, and all fits made on the way, by cause."""
    choice = step.choice
    assert choice is not None
    each, made = comparable(step), dict[str, CorrectedFit]()
    if len(each) < 2:
        return choice, made
    J, companions = [], list[CandidateFit | None]()
    for one in each:
        fit = made[one.term.name] = extended(setup, replace(choice, contenders=(one,)))
        other = None if fit.scatter is None else companion(step, setup, fit)
        other = other if other is not None and other.score > 0 else None
        companions.append(other)
        J.append(one.score + (0.0 if other is None else other.score))
    k = int(np.argmax(J))
    k = k if J[k] > J[0] + TIE else 0
    best, other = each[k], companions[k]
    if other is not None:
        fits = [(c, made[c.term.name]) for c, o in zip(each, companions, strict=True) if o is None]
        flyable = [(c, f) for c, f in fits if f.scatter is not None]
        best = single_cause(setup, other, flyable) or best
    return (choice if best is each[0] else instead(choice, best)), made
