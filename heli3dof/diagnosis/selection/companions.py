"""Which of causes that are tied: the one that explains most with one more beside it.

Alone a curve of the rotors explains a curved thrust as well as that itself does, and which of the
two wins is chance. But with the supply's sag beside it one explains the flight, and the other takes
the sag's place and leaves nothing of it: chosen first, it hides the second cause. So each of the
tied j, freed of its bias in its turn, is asked what else is then there. With S_j its score and
S_u|j that of the likeliest further term beside it (both BIC's, `selection.select`)

    J_j = S_j + max(0, max_u S_u|j)

and another than the one chosen is taken where its J is larger by more than `TIE`. Both are asked
alike, so what is wrong with a formula counts for each. A term u counts that the screen beside j
sees beyond the nulls' threshold; those nulls were seen beside neither, and are little changed by
one cause more. Where they are large (`selection.rivals`) scores compare nothing, and the
choice stands.

Two causes may also be one cause's stand-in: a dry friction and a quadratic drag follow a viscous
one, and where the yaw's encoder chatters their likelihood is too high by tens. So a pair has to
beat a tied cause that needs no companion in flights of each (`selection.rivals`), by
`DECIDED`; otherwise that one is taken, the simplest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit, correct
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.screening.nulls import Nulls
from heli3dof.diagnosis.screening.score_test import Screen
from heli3dof.diagnosis.selection.alternatives import TURNS, instead
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit, fit_candidates
from heli3dof.diagnosis.selection.rivals import FALSE, ROUNDS, false_slopes, likelihoods, odds
from heli3dof.diagnosis.selection.select import TIE, Choice, candidates_to_fit, ranked_candidates
from heli3dof.diagnosis.selection.steps import Step, extended, screened

ASKED = 4
"""Further terms that are fitted beside each"""
DECIDED = 12.0
"""Of W: twice `TIE`, since the pair was picked from many"""


def tied(step: Step) -> list[CandidateFit]:
    """The contenders of a step that may be it: the one chosen, and those tied with it; just that
    one where their scores do not compare."""
    choice = step.choice
    assert choice is not None
    best = choice.contenders[0]
    near = [c for c in choice.contenders[1:] if c.term.name in choice.tied_with][: TURNS - 1]
    each = [best, *near]
    slopes = false_slopes(step.nulls, each)
    plain = len(slopes) == len(each) and not best.term.effect.within
    return each if plain and max(slopes) <= FALSE else each[:1]


def companion(step: Step, bench: Setup, found: CorrectedFit) -> CandidateFit | None:
    """The likeliest further term beside a fit of the step's base and one more; None where none is
    seen."""
    screen, seen = screened(bench, found)
    nulls = nulls_of(step, screen)
    ranked = candidates_to_fit(ranked_candidates(seen, nulls), screen, nulls, ASKED)
    bias = np.zeros(len(found.theta)) if found.bias is None else found.bias
    fits = fit_candidates(found, screen, seen, nulls, bias, ranked)
    return next((f for f in fits if nulls.threshold <= f.Z2), None)


def simplest(
    bench: Setup, pair: CandidateFit, alone: Sequence[tuple[CandidateFit, CorrectedFit]]
) -> CandidateFit | None:
    """The likeliest of the causes ``alone`` (each with its fit) that a ``pair`` (a cause beside
    another) does not surely beat; None where it beats them all."""
    if not alone:
        return None
    both = correct(
        pair.problem, pair.optimum.theta, pair.optimum.noise, bench.recordings,
        seed=bench.seed, pilots=bench.pilots, rounds=ROUNDS,
    )  # fmt: skip
    W = odds(*likelihoods([both, *(f for _, f in alone)], bench.recordings, seed=bench.seed))
    stand = [k for k in range(1, len(W)) if W[0, k] < DECIDED]
    return alone[min(stand, key=lambda k: W[0, k]) - 1][0] if stand else None


def nulls_of(step: Step, screen: Screen) -> Nulls:
    """The step's nulls, in the order of another screen's probes."""
    own = {(p.name, p.values): i for i, p in enumerate(step.screen.plain)}
    first = len(step.screen.plain)
    own |= {(s.term.name, ()): first + k for k, s in enumerate(step.screen.scans)}
    asked = [(p.name, p.values) for p in screen.plain] + [(s.term.name, ()) for s in screen.scans]
    at = [own.get(k) for k in asked]
    n = step.nulls
    root = float(np.sqrt(n.inflation))
    mean = np.array([0.0 if i is None else n.mean[i] for i in at])
    std = np.array([root if i is None else n.std[i] for i in at])
    return replace(n, mean=mean, std=std)


def best_with_companion(bench: Setup, step: Step) -> tuple[Choice, dict[str, CorrectedFit]]:
    """The step's choice, or the one of those tied with it that explains more with a companion; and
    the fits with each of them that were made, by name."""
    choice = step.choice
    assert choice is not None
    each, made = tied(step), dict[str, CorrectedFit]()
    if len(each) < 2:
        return choice, made
    J, others = [], list[CandidateFit | None]()
    for one in each:
        found = made[one.term.name] = extended(bench, replace(choice, contenders=(one,)))
        other = None if found.scatter is None else companion(step, bench, found)
        other = other if other is not None and other.score > 0 else None
        others.append(other)
        J.append(one.score + (0.0 if other is None else other.score))
    k = int(np.argmax(J))
    k = k if J[k] > J[0] + TIE else 0
    best, other = each[k], others[k]
    if other is not None:
        fits = [(c, made[c.term.name]) for c, o in zip(each, others, strict=True) if o is None]
        flown = [(c, f) for c, f in fits if f.scatter is not None]
        best = simplest(bench, other, flown) or best
    return (choice if best is each[0] else instead(choice, best)), made
