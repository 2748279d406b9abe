"""The steps of a diagnosis: fit the base, look at it, take a cause in, try without.

Each takes what the one before made; none knows how many there are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.alike import rates_apart, widest
from heli3dof.diagnosis.catalogue import candidates, probes, scans
from heli3dof.diagnosis.corrected import (
    NOISE_NEAR,
    Corrected,
    Informed,
    correct,
    fly_again,
    look,
    model_at,
)
from heli3dof.diagnosis.nulls import Nulls, formula_nulls, loop_is_known, simulated_nulls
from heli3dof.diagnosis.rivals import told_apart
from heli3dof.diagnosis.screen import Screen, Seen
from heli3dof.diagnosis.select import Choice, choose, suspects, unidentifiable
from heli3dof.diagnosis.tilted import Tilt, maximise_tilted
from heli3dof.diagnosis.trials import Trial, ringing, standing_out, trials, tried_terms
from heli3dof.identification.greybox.estimate import Estimate, estimate
from heli3dof.identification.greybox.fit import Optimum, _better_noise
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.method import compile_first, usable_runs
from heli3dof.model.effects import Term
from heli3dof.model.effects import terms as named
from heli3dof.model.filtering import data_of
from heli3dof.model.rig_model import Structure
from heli3dof.recording.recording import Recording

TRIAL_FLIGHTS = 12
"""With which what can only be tried is compared."""
CHATTERS = 1.2
"""Inflation of a fit from which its bias is too large to start from."""
QUIETER = np.array([0.5, 0.7, 1.0, 1.0])
"""What the filter makes of a chattering flight's noise, roughly; roll and pitch chatter most."""
MUCH_QUIETER = 0.25

FAR, ROUGHER = 30.0, 1.0
"""Standard deviations of a parameter, and steps of a log noise intensity, beyond which false slopes
are no longer those that were seen: play that is left out is swollen noise, of another slope."""

UNHEARD_OF = 2.5
"""An inertia's ratio to nominal, or its inverse"""
HELD_BY = 0.1
"""Of the tolerance, to which the inertias are held until a cause is found where they ran away"""

BASES: dict[str, tuple[str, ...]] = {"rigid": (), "hover": ("base.hover",)}
"""What each base simulation is made of beside the rigid body."""


@dataclass(frozen=True)
class Bench:
    """What is diagnosed, and with how many pilot flights."""

    recordings: tuple[Recording, ...]
    seed: int
    pilots: int
    base: str = "rigid"
    """One of `BASES`"""
    opinions: bool = True
    """Whether modest scores ask a second one (`heli3dof.diagnosis.rivals`), some seconds each"""

    @property
    def loop_is_known(self) -> bool:
        return loop_is_known(self.recordings)

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

    def chosen(self, bench: Bench, first_score: float | None) -> Step:
        """The same with its choice made."""
        present = [t.name for t in self.found.problem.structure.terms]

        def made_of(tried: Sequence[Trial]) -> Choice | None:
            return choose(
                self.found, self.screen, self.seen, self.nulls, self.bias, first_score, tried
            )

        made = made_of(self.tried(bench, tried_terms(present, bench.axes)))
        if made is None and bench.loop_is_known and (rings := self.tried(bench, ringing(present))):
            made = made_of(rings)
        if made is not None and bench.loop_is_known:
            made = told_apart(
                made, self.nulls, bench.recordings, seed=bench.seed, pilots=bench.pilots,
                opinions=bench.opinions,
            )  # fmt: skip
        return replace(self, choice=made)


def base_of(bench: Bench) -> Corrected:
    """The base simulation, fitted. Raises RecordingError where there is nothing to fit."""
    runs = [run for i, r in enumerate(bench.recordings) for run in usable_runs(r, i)]
    structure = Structure(bench.recordings[0].profile, named(BASES[bench.base]))
    problem = Informed(data_of(bench.recordings, runs), structure)
    compile_first(problem)
    found = base_at(bench, problem)
    return base_at(bench, replace(problem, doubt=HELD_BY)) if runaway(found) else found


def runaway(found: Estimate) -> bool:
    """Whether an inertia is one that no rig has.

    What a rig that hardly tips lacks (a constant torque of a volt of trim, above all) is hidden as
    well by a body too heavy to answer, and noise: nothing would be seen beside these.
    """
    apart = found.theta[1:4] - found.problem.prior_mean[1:4]
    return bool(np.abs(apart[found.problem.data.axes]).max(initial=0.0) > np.log(UNHEARD_OF))


def base_at(bench: Bench, problem: Informed) -> Corrected:
    """The base's numbers as that problem has them, freed of their bias where the loop is known."""
    found = estimate(problem)
    if not bench.loop_is_known:
        return Corrected(problem, found.optimum)
    freed = correct(
        problem, *beginning(found), bench.recordings, seed=bench.seed, pilots=bench.pilots
    )
    if freed.scatter is None:
        return Corrected(problem, found.optimum)
    return quieter(bench, freed) if found.inflation >= CHATTERS else freed


def quieter(bench: Bench, found: Corrected) -> Corrected:
    """The estimate; another where its flights chatter faster than the recordings on some axis.

    Such a one is the wrong end of the ridge of which `beginning` speaks. The other is found from
    the profile's inertias and a quarter of the noise there, and taken if it has settled and its
    flights chatter no faster.
    """
    limit = widest()
    fast = rates_apart(found, bench.recordings, seed=bench.seed) < -limit
    if not fast.any():
        return found
    theta, noise = found.theta.copy(), found.optimum.noise.copy()
    theta[1:4][fast] = found.problem.prior_mean[1:4][fast]
    noise[:3][fast] *= MUCH_QUIETER
    other = correct(
        found.problem, theta, noise, bench.recordings, seed=bench.seed, pilots=bench.pilots
    )
    if other.scatter is None or not other.optimum.converged:
        return found
    apart = rates_apart(other, bench.recordings, seed=bench.seed)
    return found if (apart[fast] < -limit).any() else other


def beginning(found: Estimate) -> tuple[np.ndarray, np.ndarray]:
    """Where to start correcting from: a fit; one at less noise where the encoders chatter.

    Where they do, noise and inertia rise and fall together along a ridge of the filter's
    likelihood, and the solution is reached from its quiet end only.
    """
    problem, o = found.problem, found.optimum
    if found.inflation < CHATTERS:
        return o.theta.copy(), o.noise.copy()
    theta, noise = o.theta.copy(), o.noise.copy()
    theta[1:4] = problem.prior_mean[1:4]
    for _ in range(5):
        noise, moved = _better_noise(problem, theta, noise, problem.data.axes)
        if moved < NOISE_NEAR:
            break
    quiet = noise * QUIETER
    at = maximise_tilted(problem, theta, quiet, None, rounds=6, hold_noise=True)
    return at.theta, quiet


def looked_at(bench: Bench, found: Corrected, flights: int) -> Step:
    """The screen of every candidate beside ``found``, and its nulls."""
    problem, o = found.problem, found.optimum
    here = look(problem, o.theta, o.noise, whole=False)
    terms = candidates([t.name for t in found.structure.terms], bench.axes)
    plain = [p for t in terms for p in probes(t, problem.data.V)]
    screen = Screen(problem, o.theta, here, plain, scans(terms))
    seen = screen.see(here, prior=True)
    bias = np.zeros(len(o.theta))
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
    problem = best.problem
    if isinstance(problem, Informed):
        problem = replace(problem, doubt=1.0)
    return settled(bench, problem, best.optimum)


def settled(bench: Bench, problem: Likelihood, at: Optimum) -> Corrected:
    """The estimating equation's solution near an optimum; the optimum where no loop is known."""
    if not bench.loop_is_known:
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
    """The same fit without one of its terms: for backward elimination and for gains.

    Freed of the same false slopes where it lies near; by likelihood alone, its ``bias`` zero, where
    it has `strayed` and they, taken off along a line, would be worth more than the cause itself.
    """
    keep = np.array([f.term != term.name for f in found.free])
    structure = Structure(
        found.structure.profile, tuple(t for t in found.structure.terms if t.name != term.name)
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


def eliminated(
    bench: Bench, found: Corrected, steps: Sequence[Step]
) -> tuple[Corrected, list[Step]]:
    """Backward: a cause that later ones made superfluous goes."""
    kept = list(steps)
    taken = [s for s in steps if s.choice is not None]
    for s in taken[:-1]:
        assert s.choice is not None
        term = s.choice.term
        less = without(found, term)
        o = found.optimum
        # Both on the same likelihood: freed of false slopes, or neither.
        freed = less.bias is not None and less.bias.any()
        tilt = None
        if freed and found.bias is not None and found.noise_bias is not None:
            tilt = Tilt(found.bias, found.noise_bias, o.theta, o.noise)
        full = maximise_tilted(found.problem, o.theta, o.noise, tilt)
        won = 2 * (full.loglik - less.optimum.loglik) / s.nulls.inflation
        if won < len(term.effect.parameters) * np.log(max(len(o.at.row), 2)):
            found = settled(bench, less.problem, less.optimum)
            kept = [k for k in kept if k is not s]
    return found, kept
