"""The steps of a diagnosis: fit the base, look at it, take a cause in, try without.

Each takes what the one before made; none knows how many there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import (
    CorrectedFit,
    ProfileLikelihood,
    correct,
    model_at,
    simulate_again,
)
from heli3dof.diagnosis.estimate.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.diagnosis.estimate.evaluation import evaluate
from heli3dof.diagnosis.estimate.setup import Setup
from heli3dof.diagnosis.screening.catalogue import candidates, probes, scans
from heli3dof.diagnosis.screening.grid_trials import (
    GridTrial,
    ringing,
    standing_out,
    trials,
    tried_terms,
    widened,
)
from heli3dof.diagnosis.screening.nulls import (
    Nulls,
    formula_nulls,
    simulated_nulls,
)
from heli3dof.diagnosis.screening.score_test import Screen, ScreenResult
from heli3dof.diagnosis.selection.candidate_fits import CandidateFit
from heli3dof.diagnosis.selection.inertia_alternatives import (
    cause_hidden_in_inertia,
    instead_of_inertia,
)
from heli3dof.diagnosis.selection.parameter_price import price
from heli3dof.diagnosis.selection.rivals import compared_by_simulation
from heli3dof.diagnosis.selection.select import Choice, choose, ranked_candidates, unidentifiable
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.model.effects import Term
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map

TRIAL_FLIGHTS = 12
"""With which what can only be tried is compared."""
FAR, ROUGHER = 30.0, 1.0
"""Standard deviations of a parameter, and steps of a log noise intensity, beyond which false slopes
are no longer those that were seen: play that is left out is swollen noise, of another slope."""
MUCH_QUIETER = 0.25
"""What an extension that does not fly is fitted again from, twice, of its noise"""


@dataclass(frozen=True, eq=False)
class Step:
    """One look at what is left: the screen of the recordings and of the nulls, and the choice."""

    found: CorrectedFit
    screen: Screen
    seen: ScreenResult
    nulls: Nulls
    bias: np.ndarray
    """(n,) mean scores of the nulls"""
    unseen: tuple[str, ...]
    """Terms of which these recordings could not tell even a large size"""
    choice: Choice | None = None
    _fits: dict[str, list[CandidateFit]] = field(default_factory=dict)
    """Of `selection.inertia_alternatives`, made once"""

    @property
    def largest(self) -> list[tuple[str, float]]:
        """The three terms that stand out most, with their Z²."""
        return [(t.name, z) for t, z, _ in ranked_candidates(self.seen, self.nulls)[:3]]

    def tried(self, bench: Setup, asked: Sequence[Term]) -> list[GridTrial]:
        """Those that are worth a fit, and more so than in flights of the estimate."""
        o, problem = self.found.optimum, self.found.problem
        tried = trials(problem, o.theta, o.noise, asked)
        if not tried or self.found.scatter is None:
            return tried
        model = model_at(problem, o.theta, o.noise)
        flown = [
            simulate_again(model, bench.recordings, problem.data, (bench.seed, 3, b))
            for b in range(TRIAL_FLIGHTS)
        ]
        return [t for t in tried if standing_out(t, problem, o.theta, o.noise, flown)]

    @property
    def instead_of_inertia(self) -> list[CandidateFit]:
        """Terms with which the inertias that are surely off are not."""
        if "inertia" not in self._fits:
            self._fits["inertia"] = instead_of_inertia(
                self.found, self.screen, self.seen, self.nulls, self.bias
            )
        return self._fits["inertia"]

    def chosen(self, bench: Setup, first_score: float | None) -> Step:
        """The same with its choice made."""
        present = [t.name for t in self.found.problem.structure.terms]

        def made_of(tried: Sequence[GridTrial]) -> Choice | None:
            return choose(
                self.found, self.screen, self.seen, self.nulls, self.bias, first_score, tried
            )

        made = made_of(self.tried(bench, tried_terms(present, bench.axes)))
        if (
            made is None
            and bench.controller_is_known
            and (rings := self.tried(bench, ringing(present)))
        ):
            made = made_of(rings)
        if made is None and bench.controller_is_known:
            made = cause_hidden_in_inertia(self.instead_of_inertia, self.screen, self.nulls)
        if made is not None and bench.controller_is_known:
            made = compared_by_simulation(
                made, self.nulls, bench.recordings, seed=bench.seed, pilots=bench.pilots,
                opinions=bench.opinions and not made.term.effect.formal,  # its ties are not told
            )  # fmt: skip
        return replace(self, choice=made)


def screened(bench: Setup, found: CorrectedFit) -> tuple[Screen, ScreenResult]:
    """Every candidate beside ``found``, and what the recordings show of each."""
    problem, o = found.problem, found.optimum
    here = evaluate(problem, o.theta, o.noise, whole=False)
    terms = candidates([t.name for t in problem.structure.terms], bench.axes)
    plain = [p for t in terms for p in probes(t, problem.data.V)]
    screen = Screen(problem, o.theta, here, plain, scans(terms))
    return screen, screen.see(here, prior=True)


def screening_step(bench: Setup, found: CorrectedFit, flights: int) -> Step:
    """The screen of every candidate beside ``found``, and its nulls."""
    screen, seen = screened(bench, found)
    bias = np.zeros(len(found.theta))
    if found.scatter is not None:
        nulls, scores = simulated_nulls(
            found, bench.recordings, screen, flights=flights, seed=bench.seed
        )
        bias = scores.mean(axis=0)
    else:
        nulls = formula_nulls(found, screen)
    return Step(found, screen, seen, nulls, bias, unidentifiable(screen, nulls))


def extended(bench: Setup, choice: Choice) -> CorrectedFit:
    """The base with the term taken, freed of its bias in its turn."""
    best = choice.contenders[0]
    problem, at = best.problem, best.optimum
    if isinstance(problem, ProfileLikelihood):
        problem = replace(problem, doubt=1.0)
    if best.term.effect.formal:
        also = [c for c in choice.contenders[1:] if surely(c, choice)]
        problem, at = as_well(problem, at, also)
    found = bias_corrected(bench, problem, at)
    if found.scatter is None and bench.controller_is_known:
        return fit_from_low_noise(bench, found)
    return found


def surely(other: CandidateFit, choice: Choice) -> bool:
    """Whether another way of writing the body's equations was seen as plainly as the one taken."""
    return other.term.effect.formal and min(other.Z2, other.score) >= choice.threshold


def as_well(
    problem: Likelihood, at: Optimum, others: Sequence[CandidateFit]
) -> tuple[Likelihood, Optimum]:
    """With those taken too, which stands for steps of their own: they hardly share a trace."""
    theta = at.theta
    for c in others:
        problem = widened(problem, theta, c.term)
        theta = np.append(theta, c.optimum.theta[-1])
    return problem, maximise_corrected(problem, theta, at.noise, None) if others else at


def fit_from_low_noise(bench: Setup, found: CorrectedFit) -> CorrectedFit:
    """The likeliest fit from much less noise and the profile's inertias, settled; ``found`` where
    that is no likelier, or could not have been flown either and no stop is to blame.

    Noise that the base needed to cover a cause is a summit of its own: the climb that takes the
    cause in starts on it and does not come down, and a rig so rough does not stay in the air.
    """
    problem, o = found.problem, found.optimum
    theta = o.theta.copy()
    theta[1:4] = problem.prior_mean[1:4]
    axes = np.append(problem.free_noise, False)
    fits = [
        maximise_corrected(problem, theta, np.where(axes, o.noise * share, o.noise), None)
        for share in (MUCH_QUIETER, MUCH_QUIETER**2)
    ]
    best = max(fits, key=lambda f: f.loglik)
    if not best.loglik > o.loglik:
        return found
    quiet = bias_corrected(bench, problem, best)
    return found if quiet.scatter is None and not bench.touches_stops else quiet


def bias_corrected(bench: Setup, problem: Likelihood, at: Optimum) -> CorrectedFit:
    """The estimating equation's solution near an optimum; the optimum where no loop is known."""
    if not bench.controller_is_known:
        return CorrectedFit(problem, at)
    return correct(
        problem,
        at.theta,
        at.noise,
        bench.recordings,
        seed=bench.seed,
        pilots=bench.pilots,
        rounds=4,
    )


def bias_corrected_again(bench: Setup, found: CorrectedFit) -> CorrectedFit:
    """The same structure, freed of its bias anew; the base's own fit where no term is left."""
    return bias_corrected(bench, found.problem, found.optimum)


def without(found: CorrectedFit, term: Term) -> CorrectedFit:
    """The same fit without one of its terms: for backward elimination and for gains; made once.

    Freed of the same false slopes where it lies near; by likelihood alone, its ``bias`` zero, where
    it has `strayed` and they, taken off along a line, would be worth more than the cause itself.
    """
    return _without(found, term.name)


@lru_cache(maxsize=8)
def _without(found: CorrectedFit, name: str) -> CorrectedFit:
    keep = np.array([f.term != name for f in found.free])
    structure = Structure(
        found.structure.profile, tuple(t for t in found.structure.terms if t.name != name)
    )
    problem = replace(found.problem, structure=structure)
    theta = found.optimum.theta[keep]
    bias = np.zeros(len(theta)) if found.bias is None else found.bias[keep]
    none = np.zeros(3) if found.noise_bias is None else found.noise_bias
    fit = maximise_corrected(
        problem, theta, found.optimum.noise, ScoreBias(bias, none, theta, found.optimum.noise)
    )
    if strayed(found, keep, fit):
        bias, none = np.zeros(len(theta)), np.zeros(3)
        fit = maximise_corrected(problem, theta, found.optimum.noise, None)
    scatter = None if found.scatter is None else found.scatter[np.ix_(keep, keep)]
    return CorrectedFit(problem, fit, scatter, bias, none, found.flights)


def as_written(base: CorrectedFit, found: CorrectedFit) -> CorrectedFit:
    """The base simulation with its body's equations written as ``found`` has them: refitted."""
    if not found.structure.formal:
        return base
    own = {t.name for t in base.structure.terms}
    for t in found.structure.terms:
        if t.name not in own and not t.effect.formal:
            found = without(found, t)
    return found


def strayed(found: CorrectedFit, keep: np.ndarray, fit: Optimum) -> bool:
    """Whether a fit of the coordinates ``keep`` ((n,) bool) of ``found`` lies far from there."""
    o = found.optimum
    A = o.information + np.diag(found.problem.prior_precision)
    sd = np.sqrt(np.diag(np.linalg.inv(A)))[keep]
    rougher = np.abs(np.log(fit.noise[:3] / o.noise[:3]))[found.problem.data.axes]
    moved = np.abs(fit.theta - o.theta[keep]) / sd
    return bool(moved.max() > FAR or rougher.max(initial=0.0) > ROUGHER)


@lru_cache(maxsize=2)
def full(found: CorrectedFit, freed: bool) -> Optimum:
    """The same fit by likelihood, ``freed`` of its false slopes or not."""
    o, tilt = found.optimum, None
    if freed and found.bias is not None and found.noise_bias is not None:
        tilt = ScoreBias(found.bias, found.noise_bias, o.theta, o.noise)
    return maximise_corrected(found.problem, o.theta, o.noise, tilt)


def backward_elimination(
    bench: Setup, found: CorrectedFit, steps: Sequence[Step]
) -> tuple[CorrectedFit, list[Step]]:
    """Backward: a cause that later ones made superfluous goes."""
    kept = list(steps)
    taken = [s for s in steps if s.choice is not None]
    if len(taken) > 1:  # beside each other; what is without each is asked for again (`measured`)
        terms = [s.choice.term for s in taken if s.choice is not None]
        parallel_map(
            lambda i: without(found, terms[i]) if i < len(terms) else full(found, True),
            len(terms) + 1,
        )
    for s in taken[:-1]:
        assert s.choice is not None
        term = s.choice.term
        less = without(found, term)
        # Both on the same likelihood: freed of false slopes, or neither.
        whole = full(found, less.bias is not None and bool(less.bias.any()))
        won = 2 * (whole.loglik - less.optimum.loglik) / s.nulls.inflation
        if won < price(found.problem, found.optimum, term.name, s.nulls.inflation):
            found = bias_corrected(bench, less.problem, less.optimum)
            kept = [k for k in kept if k is not s]
    return found, kept
