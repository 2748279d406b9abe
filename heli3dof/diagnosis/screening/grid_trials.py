"""Evaluate the likelihood of terms that the score test cannot detect, on a parameter grid.

The score of encoder backlash is zero at zero backlash, so the score test cannot detect it. Instead,
the gain in log-likelihood ℓ is computed at a value w of the term's first parameter,

    Δℓ(w) = ℓ(θ, w, a) − ℓ(θ, 0, a)

θ and a are the base fit's parameters and noise intensities. w ascends the term's grid as long as
Δℓ(w) rises; ŵ is the last value at which it rose. A term is fitted in full if both hold:

1. Δℓ(ŵ) > `MIN_TRIAL_GAIN`.
2. If the controller is known: Δℓ(ŵ) > max Δℓ_null(ŵ) + `MIN_TRIAL_GAIN`, with the largest gain
   Δℓ_null over flights simulated from the base fit. Without this condition, an axis with little
   motion could have a large Δℓ by chance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import better_noise
from heli3dof.model.effects import Term
from heli3dof.model.estimation.filter_data import Data
from heli3dof.parallel import parallel_map

MIN_TRIAL_GAIN = 40.0
"""Least Δℓ for a full fit. Chosen: Δℓ is over 100 with backlash, below −100 without."""
NOISE_ROUNDS, NOISE_TOLERANCE = 4, 0.1
"""Most updates of the noise at one value; change of ln a that ends them. Chosen; not derived."""
NEIGHBOURS = 3
"""Values on either side of the best one that are evaluated in the second round. Chosen."""


@dataclass(frozen=True)
class GridTrial:
    """A term at one ``value`` of its first parameter, and its gain in log-likelihood there."""

    term: Term
    value: float
    gain: float
    """Δℓ"""


def trials(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, untested: Sequence[Term]
) -> list[GridTrial]:
    """Return the trials of the terms ``untested`` with Δℓ > `MIN_TRIAL_GAIN`.

    Δℓ is the gain in log-likelihood over the base fit with parameters ``theta`` (n,). ``noise``
    (4,): process noise of three axes, sampling jitter.
    """
    base = float(problem.run(theta, noise, keep=0).loglik.sum())

    def one(k: int) -> GridTrial:
        ext = with_term_added(problem, untested[k])
        best = GridTrial(untested[k], 0.0, -np.inf)
        for value in untested[k].effect.starts:
            at = np.append(theta, ext.structure.free[-1].scaled(value))
            gain = float(ext.run(at, noise, keep=0).loglik.sum()) - base
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
    """Return True if the trial's Δℓ exceeds that in every simulated flight by `MIN_TRIAL_GAIN`.

    Δℓ is the gain in log-likelihood by the trial's term. ``nulls``: simulated without the term.
    """
    ext, at = with_term_at(problem, theta, trial.term, (trial.value,))

    def one(b: int) -> float:
        extended = replace(ext, data=nulls[b]).run(at, noise, keep=0).loglik.sum()
        base = replace(problem, data=nulls[b]).run(theta, noise, keep=0).loglik.sum()
        return float(extended - base)

    gains = np.array(parallel_map(one, len(nulls), what="flights"))
    return bool(trial.gain > gains.max() + MIN_TRIAL_GAIN)


def with_term_added(problem: Likelihood, term: Term) -> Likelihood:
    """Return the likelihood of the model with ``term`` added."""
    return replace(problem, structure=problem.structure.with_terms(term))


def with_term_at(
    problem: Likelihood, theta: np.ndarray, term: Term, values: Sequence[float]
) -> tuple[Likelihood, np.ndarray]:
    """Return the likelihood with ``term`` added, and θ (n + m,) with ``values`` of its parameters.

    ``theta`` (n,): the parameters of ``problem``. ``values``: of the first parameters of the term.
    """
    ext = with_term_added(problem, term)
    new = zip(ext.structure.free[len(theta) :], values, strict=False)
    return ext, np.append(theta, [f.scaled(v) for f, v in new])


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
            loglik[i] = float(ext.run(full, a, keep=0).loglik.sum())
        best = max(loglik, key=lambda i: loglik[i])
        indices = range(max(best - NEIGHBOURS, 0), min(best + NEIGHBOURS + 1, len(values)))
        full[j] = values[best]
        for _ in range(NOISE_ROUNDS):
            a, moved = better_noise(ext, full, a, ext.free_noise)
            if moved < NOISE_TOLERANCE:
                break
    return full, a
