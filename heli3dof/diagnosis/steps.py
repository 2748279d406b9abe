"""The steps of a diagnosis: fit the base, look at it, take a cause in, try without.

Each takes what the one before made; none knows how many there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.catalogue import candidates, probes, scans
from heli3dof.diagnosis.contenders import Contender
from heli3dof.diagnosis.corrected import Corrected, Informed, correct, fly_again, model_at
from heli3dof.diagnosis.looks import look
from heli3dof.diagnosis.nulls import Nulls, controller_is_known, formula_nulls, simulated_nulls
from heli3dof.diagnosis.occam import price
from heli3dof.diagnosis.rivals import told_apart
from heli3dof.diagnosis.screen import Screen, Seen
from heli3dof.diagnosis.select import Choice, choose, suspects, unidentifiable
from heli3dof.diagnosis.swallowed import instead_of_inertia, swallowed
from heli3dof.diagnosis.tilted import Tilt, maximise_tilted
from heli3dof.diagnosis.trials import Trial, ringing, standing_out, trials, tried_terms, widened
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.identification.row_selection import unusable
from heli3dof.model.effects import Term
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

TRIAL_FLIGHTS = 12
"""With which what can only be tried is compared."""
FAR, ROUGHER = 30.0, 1.0
"""Standard deviations of a parameter, and steps of a log noise intensity, beyond which false slopes
are no longer those that were seen: play that is left out is swollen noise, of another slope."""
MUCH_QUIETER = 0.25
"""What an extension that does not fly is fitted again from, twice, of its noise"""


@dataclass(frozen=True)
class Bench:
    """What is diagnosed, and with how many pilot flights."""

    recordings: tuple[Recording, ...]
    seed: int
    pilots: int
    base: str = "rigid"
    """One of `heli3dof.diagnosis.base_fit.BASES`"""
    opinions: bool = True
    """Whether modest scores ask a second one (`heli3dof.diagnosis.rivals`), some seconds each"""

    @property
    def controller_is_known(self) -> bool:
        return controller_is_known(self.recordings)

    @cached_property
    def touches_stops(self) -> bool:
        """Whether a stop held the arm: flights of a fit know of none, and need not stay near."""
        return any(unusable(r)["stop"].any() for r in self.recordings)

    @property
    def axes(self) -> list[str]:
        return [a for a in AXES if any(a in r.axes for r in self.recordings)]


@dataclass(frozen=True, eq=False)
class Step:
    """One look at what is left: the screen of the recordings and of the nulls, and the choice."""

    found: Corrected
    screen: Screen
    seen: Seen
    nulls: Nulls
    bias: np.ndarray
    """(n,) mean scores of the nulls"""
    unseen: tuple[str, ...]
    """Terms of which these recordings could not tell even a large size"""
    choice: Choice | None = None
    _fits: dict[str, list[Contender]] = field(default_factory=dict)
    """Of `heli3dof.diagnosis.swallowed`, made once"""

    @property
    def largest(self) -> list[tuple[str, float]]:
        """The three terms that stand out most, with their Z²."""
        return [(t.name, z) for t, z, _ in suspects(self.seen, self.nulls)[:3]]

    def tried(self, bench: Bench, asked: Sequence[Term]) -> list[Trial]:
        """Those that are worth a fit, and more so than in flights of the estimate."""
        o, problem = self.found.optimum, self.found.problem
        tried = trials(problem, o.theta, o.noise, asked)
        if not tried or self.found.scatter is None:
            return tried
        model = model_at(problem, o.theta, o.noise)
        flown = [
            fly_again(model, bench.recordings, problem.data, (bench.seed, 3, b))
            for b in range(TRIAL_FLIGHTS)
        ]
        return [t for t in tried if standing_out(t, problem, o.theta, o.noise, flown)]

    @property
    def instead_of_inertia(self) -> list[Contender]:
        """Terms with which the inertias that are surely off are not."""
        if "inertia" not in self._fits:
            self._fits["inertia"] = instead_of_inertia(
                self.found, self.screen, self.seen, self.nulls, self.bias
            )
        return self._fits["inertia"]

    def chosen(self, bench: Bench, first_score: float | None) -> Step:
        """The same with its choice made."""
        present = [t.name for t in self.found.problem.structure.terms]

        def made_of(tried: Sequence[Trial]) -> Choice | None:
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
            made = swallowed(self.instead_of_inertia, self.screen, self.nulls)
        if made is not None and bench.controller_is_known:
            made = told_apart(
                made, self.nulls, bench.recordings, seed=bench.seed, pilots=bench.pilots,
                opinions=bench.opinions and not made.term.effect.formal,  # its ties are not told
            )  # fmt: skip
        return replace(self, choice=made)


def screened(bench: Bench, found: Corrected) -> tuple[Screen, Seen]:
    """Every candidate beside ``found``, and what the recordings show of each."""
    problem, o = found.problem, found.optimum
    here = look(problem, o.theta, o.noise, whole=False)
    terms = candidates([t.name for t in problem.structure.terms], bench.axes)
    plain = [p for t in terms for p in probes(t, problem.data.V)]
    screen = Screen(problem, o.theta, here, plain, scans(terms))
    return screen, screen.see(here, prior=True)


def looked_at(bench: Bench, found: Corrected, flights: int) -> Step:
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


def extended(bench: Bench, choice: Choice) -> Corrected:
    """The base with the term taken, freed of its bias in its turn."""
    best = choice.contenders[0]
    problem, at = best.problem, best.optimum
    if isinstance(problem, Informed):
        problem = replace(problem, doubt=1.0)
    if best.term.effect.formal:
        also = [c for c in choice.contenders[1:] if surely(c, choice)]
        problem, at = as_well(problem, at, also)
    found = settled(bench, problem, at)
    if found.scatter is None and bench.controller_is_known:
        return from_quiet(bench, found)
    return found


def surely(other: Contender, choice: Choice) -> bool:
    """Whether another way of writing the body's equations was seen as plainly as the one taken."""
    return other.term.effect.formal and min(other.Z2, other.score) >= choice.threshold


def as_well(
    problem: Likelihood, at: Optimum, others: Sequence[Contender]
) -> tuple[Likelihood, Optimum]:
    """With those taken too, which stands for steps of their own: they hardly share a trace."""
    theta = at.theta
    for c in others:
        problem = widened(problem, theta, c.term)
        theta = np.append(theta, c.optimum.theta[-1])
    return problem, maximise_tilted(problem, theta, at.noise, None) if others else at


def from_quiet(bench: Bench, found: Corrected) -> Corrected:
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
        maximise_tilted(problem, theta, np.where(axes, o.noise * share, o.noise), None)
        for share in (MUCH_QUIETER, MUCH_QUIETER**2)
    ]
    best = max(fits, key=lambda f: f.loglik)
    if not best.loglik > o.loglik:
        return found
    quiet = settled(bench, problem, best)
    return found if quiet.scatter is None and not bench.touches_stops else quiet


def settled(bench: Bench, problem: Likelihood, at: Optimum) -> Corrected:
    """The estimating equation's solution near an optimum; the optimum where no loop is known."""
    if not bench.controller_is_known:
        return Corrected(problem, at)
    return correct(
        problem,
        at.theta,
        at.noise,
        bench.recordings,
        seed=bench.seed,
        pilots=bench.pilots,
        rounds=4,
    )


def settled_again(bench: Bench, found: Corrected) -> Corrected:
    """The same structure, freed of its bias anew; the base's own fit where no term is left."""
    return settled(bench, found.problem, found.optimum)


def without(found: Corrected, term: Term) -> Corrected:
    """The same fit without one of its terms: for backward elimination and for gains; made once.

    Freed of the same false slopes where it lies near; by likelihood alone, its ``bias`` zero, where
    it has `strayed` and they, taken off along a line, would be worth more than the cause itself.
    """
    return _without(found, term.name)


@lru_cache(maxsize=8)
def _without(found: Corrected, name: str) -> Corrected:
    keep = np.array([f.term != name for f in found.free])
    structure = Structure(
        found.structure.profile, tuple(t for t in found.structure.terms if t.name != name)
    )
    problem = replace(found.problem, structure=structure)
    theta = found.optimum.theta[keep]
    bias = np.zeros(len(theta)) if found.bias is None else found.bias[keep]
    none = np.zeros(3) if found.noise_bias is None else found.noise_bias
    fit = maximise_tilted(
        problem, theta, found.optimum.noise, Tilt(bias, none, theta, found.optimum.noise)
    )
    if strayed(found, keep, fit):
        bias, none = np.zeros(len(theta)), np.zeros(3)
        fit = maximise_tilted(problem, theta, found.optimum.noise, None)
    scatter = None if found.scatter is None else found.scatter[np.ix_(keep, keep)]
    return Corrected(problem, fit, scatter, bias, none, found.flights)


def strayed(found: Corrected, keep: np.ndarray, fit: Optimum) -> bool:
    """Whether a fit of the coordinates ``keep`` ((n,) bool) of ``found`` lies far from there."""
    o = found.optimum
    A = o.information + np.diag(found.problem.prior_precision)
    sd = np.sqrt(np.diag(np.linalg.inv(A)))[keep]
    rougher = np.abs(np.log(fit.noise[:3] / o.noise[:3]))[found.problem.data.axes]
    moved = np.abs(fit.theta - o.theta[keep]) / sd
    return bool(moved.max() > FAR or rougher.max(initial=0.0) > ROUGHER)


@lru_cache(maxsize=2)
def full(found: Corrected, freed: bool) -> Optimum:
    """The same fit by likelihood, ``freed`` of its false slopes or not."""
    o, tilt = found.optimum, None
    if freed and found.bias is not None and found.noise_bias is not None:
        tilt = Tilt(found.bias, found.noise_bias, o.theta, o.noise)
    return maximise_tilted(found.problem, o.theta, o.noise, tilt)


def eliminated(
    bench: Bench, found: Corrected, steps: Sequence[Step]
) -> tuple[Corrected, list[Step]]:
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
            found = settled(bench, less.problem, less.optimum)
            kept = [k for k in kept if k is not s]
    return found, kept
