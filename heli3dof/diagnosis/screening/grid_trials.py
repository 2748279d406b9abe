"""Terms that no slope points at: tried at a value, on the likelihood itself.

Play between an axis and its encoder leaves nothing in the innovations of a filter that knows of
none (it puts all of it down to process noise), so no screen sees it. But the likelihood of a little
play w beside that of none, everything else and the noise held,

    Δℓ(w) = ℓ(θ, w, a) − ℓ(θ, 0, a)

tells the two apart at once: where the encoder has no play its edges lie w/2 off where the filter
then expects them, which costs hundreds; where it has, and the noise was swollen to cover it, Δℓ is
positive. An axis that hardly moves tells little, and Δℓ scatters widely there: it must also stand
out from the largest that it is in flights of the estimate itself, where there is no play,

    Δℓ > max Δℓ_null + `WORTH`

Likewise where nothing else was found: a base that knows of no lag can put a loop that rings with it
down to noise, so much that no slope is left to be seen. Then `RINGS` are tried.

Such a term is fitted in full, from the likeliest of its ``starts`` with the noise settled
at each of two rounds, and compared with the others by the same score.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.screening.score_test import with_term
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import better_noise
from heli3dof.model.effects import Term, effects, terms
from heli3dof.model.estimation.filter_data import Data
from heli3dof.parallel import parallel_map

WORTH = 40.0
"""Δℓ of the first of the ``starts`` from which on a term is fitted: play scores hundreds there,
flights without it lose as much."""
RINGS = {"motor.lag": (0.02, 0.035, 0.06, 0.1, 0.17), "motor.delay": (0.01, 0.02, 0.04)}
"""Terms that a slope points at as a rule, and values at which they are tried where none does; s."""
SETTLING = 4
SETTLED = 0.1
NEIGHBOURS = 3
"""Rounds of the noise at a value; the move of its logarithm at which they end; how many values to
either side are tried again."""


@dataclass(frozen=True)
class GridTrial:
    """A term at a value of its first parameter (in its unit), and what that wins."""

    term: Term
    value: float
    gain: float
    """Δℓ"""


def starts(term: Term) -> tuple[float, ...]:
    """The values of its first parameter at which it is tried, rising."""
    return term.effect.starts or RINGS[term.name]


def ringing(without: Sequence[str]) -> list[Term]:
    """`RINGS` but those named ``without``."""
    return [t for t in terms(list(RINGS)) if t.name not in without]


def rings(term: Term) -> bool:
    """Whether it is one of `RINGS`, tried as a last resort."""
    return term.name in RINGS


def tried_terms(without: Sequence[str], axes: Sequence[str]) -> list[Term]:
    """Every term that has to be tried, but those named ``without``; on the ``axes`` measured."""
    return [
        t
        for e in effects().values()
        if e.starts and e.hooks
        for t in ([Term(e, a) for a in e.axes if a in axes] if e.axes else [Term(e)])
        if t.name not in without
    ]


def trials(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, asked: Sequence[Term]
) -> list[GridTrial]:
    """Those of the terms that are worth a fit, beside the point ``theta`` (n,), ``noise`` (4,)."""
    none = float(problem.run(theta, noise, keep=0).loglik.sum())

    def one(k: int) -> GridTrial:
        value = starts(asked[k])[0]
        ext = widened(problem, theta, asked[k])
        at = np.append(theta, ext.structure.free[-1].inward(value))
        return GridTrial(asked[k], value, float(ext.run(at, noise, keep=0).loglik.sum()) - none)

    return [t for t in parallel_map(one, len(asked), what="trials") if t.gain > WORTH]


def standing_out(
    found: GridTrial,
    problem: Likelihood,
    theta: np.ndarray,
    noise: np.ndarray,
    nulls: Sequence[Data],
) -> bool:
    """True where Δℓ is above what it is in any of the ``nulls``, at the same point."""
    ext = widened(problem, theta, found.term)
    at = np.append(theta, ext.structure.free[-1].inward(found.value))

    def one(b: int) -> float:
        with_it = replace(ext, data=nulls[b]).run(at, noise, keep=0).loglik.sum()
        none = replace(problem, data=nulls[b]).run(theta, noise, keep=0).loglik.sum()
        return float(with_it - none)

    gains = np.array(parallel_map(one, len(nulls), what="flights"))
    return bool(found.gain > gains.max() + WORTH)


def widened(problem: Likelihood, theta: np.ndarray, term: Term) -> Likelihood:
    """The likelihood with one more term."""
    return replace(problem, structure=with_term(problem.structure, problem.values(theta), term)[0])


def beginning(
    ext: Likelihood, theta: np.ndarray, noise: np.ndarray, term: Term
) -> tuple[np.ndarray, np.ndarray]:
    """(coordinates (n + m,), noise (4,)) from which to fit: the likeliest of the term's values.

    Twice, since what is likeliest depends on the noise, and the noise on it: every other value
    first, then those about the best one.
    """
    new = ext.structure.free[len(theta) :]
    full = np.concatenate([theta, [f.inward(f.start) for f in new]])
    j, a = len(theta), noise.copy()
    values = [new[0].inward(v) for v in starts(term)]
    best, near = 0, range(0, len(values), 2)
    for _ in range(2):
        worth = {}
        for i in near:
            full[j] = values[i]
            worth[i] = float(ext.run(full, a, keep=0).loglik.sum())
        best = max(worth, key=lambda i: worth[i])
        near = range(max(best - NEIGHBOURS, 0), min(best + NEIGHBOURS + 1, len(values)))
        full[j] = values[best]
        for _ in range(SETTLING):
            a, moved = better_noise(ext, full, a, ext.free_noise)
            if moved < SETTLED:
                break
    return full, a
