"""Perform the steps of forward selection: each step adds one cause to the model.

1. `screening_step` computes the score test of all candidates on the recordings. Null simulations,
   which contain none of the candidates, give the distribution of the scores.
2. `Step.chosen` refits the model with each of the best candidates added, and chooses the next cause
   (`search.select`).
3. `fit_with_cause` returns the bias-corrected fit of the model with that cause.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from heli3dof.diagnosis.search.candidate_fits import (
    CandidateFit,
    GridTrial,
    correction_starts,
    exceeds_nulls,
    trials,
)
from heli3dof.diagnosis.search.catalogue import (
    candidates,
    probes,
    scans,
    terms_without_score,
)
from heli3dof.diagnosis.search.nulls import formula_nulls, simulated_nulls
from heli3dof.diagnosis.search.rivals import compared_by_simulation
from heli3dof.diagnosis.search.score_test import Screen
from heli3dof.diagnosis.search.screening import Screening
from heli3dof.diagnosis.search.select import (
    Choice,
    best_choice,
    choose,
    least_difference,
    with_ties,
)
from heli3dof.identification.bias_correction.corrected_maximum import ScoreBias, maximise_corrected
from heli3dof.identification.bias_correction.correction import (
    CorrectedFit,
    correct,
    model_at,
    simulate_again,
)
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.closed_loop_fit.base_fit import with_plausible_inertias
from heli3dof.identification.closed_loop_fit.edge_rates import fit_with_edge_rates
from heli3dof.identification.closed_loop_fit.limit_cycle import scatters_on_limit_cycle
from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.model.effects import Term
from heli3dof.model.physics.parametrisation import Structure

TRIAL_FLIGHTS = 12
"""Null simulations for terms that the score test cannot detect. Chosen; not derived."""
MAX_SHIFT, MAX_NOISE_SHIFT = 30.0, 1.0
"""Range of a bias correction, in standard deviations of θ and in ln(noise intensity). Chosen."""


@dataclass(frozen=True, eq=False)
class Step(Screening):
    """A step of forward selection: score tests of the current fit, and the choice of a cause."""

    choice: Choice | None = None

    def significant_trials(self, setup: Setup, untested: Sequence[Term]) -> list[GridTrial]:
        """Return those of the ``untested`` terms whose log-likelihood gain justifies a refit.

        ``untested``: terms that the score test cannot detect. Each is tried at several values of
        its first parameter, and returned with the value of largest log-likelihood. If flights can
        be simulated, the gain must also exceed the gain in null simulations.
        """
        o, problem = self.fit.optimum, self.fit.problem
        tried = trials(problem, o.theta, o.noise, untested)
        if not tried or not self.fit.is_corrected:
            return tried
        model = model_at(problem, o.theta, o.noise)
        flown = [
            simulate_again(model, setup.recordings, problem.data, (setup.seed, 3, b))
            for b in range(TRIAL_FLIGHTS)
        ]
        return [t for t in tried if exceeds_nulls(t, problem, o.theta, o.noise, flown)]

    def chosen(self, setup: Setup, earlier_score: float | None) -> Step:
        """Return this step with the next cause as its ``choice``, or None if there is none.

        ``earlier_score``: largest score of the earlier causes (`search.select`), or None.
        """
        present = [t.name for t in self.fit.problem.structure.terms]
        without = (*present, *setup.refuted)
        tried = self.significant_trials(setup, terms_without_score(without, setup.explained_axes))
        choice = choose(self, earlier_score, tried)
        if choice is not None and setup.controller_is_known:
            choice = compared_by_simulation(
                choice,
                self.fit,
                self.nulls,
                setup.recordings,
                seed=setup.seed,
                flights_per_round=setup.flights_per_round,
            )
        return replace(self, choice=choice)

    def next_choice(self, diverged: Sequence[str], earlier_score: float | None) -> Step:
        """Return this step with the next best candidate as its ``choice``, or None.

        ``diverged``: names of the candidates that this step chose before. They were rejected,
        because simulated flights of the model with such a candidate diverge. They are reported as
        confounded with the new choice. ``earlier_score``: as in `chosen`.
        """
        assert self.choice is not None
        rest = [c for c in self.choice.candidates if c.term.name not in diverged]
        choice = best_choice(self, rest, earlier_score)
        if choice is not None:
            choice = replace(choice, tied_with=(*diverged, *choice.tied_with))
        return replace(self, choice=choice)


def with_rivals_that_remain(steps: Sequence[Step]) -> list[Step]:
    """Return the steps; the ``tied_with`` of each cause also names rivals that remain significant.

    A rival is another candidate of the step that chose the cause. It is added if both hold:

    - The rival's Z² in the last step is below half of its Z² in the cause's step. So the cause
      explains much of what the rival would explain.
    - The rival's Z² in the last step still reaches the threshold, and `least_difference`: the
      smallest number that an inexact formula of the cause does not explain.

    If the last step chose a cause, no rival is added.
    """
    if not steps or steps[-1].choice is not None:
        return list(steps)
    last = steps[-1]
    Z2 = {t.name: Z2 for t, Z2, _ in last.ranked if last.nulls.threshold_of(t) <= Z2}
    out = []
    for s in steps:
        choice = s.choice
        if choice is not None:
            least = least_difference(choice.score)
            rivals = [(c, Z2.get(c.term.name, 0.0)) for c in choice.candidates[1:]]
            remain = (c.term.name for c, z in rivals if least < z < c.statistic / 2)
            choice = with_ties(choice, remain)
        out.append(replace(s, choice=choice))
    return out


def screening_step(setup: Setup, fit: CorrectedFit, flights: int) -> Step:
    """Return the next step of forward selection after ``fit``; its ``choice`` is still None.

    The step contains the scores of all candidates, and the distribution that these scores have
    without any further effect. ``flights``: number of flights to simulate for this distribution. If
    ``fit`` was not bias-corrected by simulated flights, a formula gives the distribution.
    """
    problem, o = fit.problem, fit.optimum
    recorded = evaluate(problem, o.theta, o.noise, with_noise_derivatives=False)
    present = [t.name for t in problem.structure.terms]
    terms = candidates(present, setup.explained_axes, setup.refuted)
    plain = [p for t in terms for p in probes(t, problem.data.V)]
    screen = Screen(problem, o.theta, recorded, plain, scans(terms))
    bias = np.zeros(len(fit.theta))
    if fit.is_corrected:
        nulls, scores = simulated_nulls(
            fit, setup.recordings, screen, flights=flights, seed=setup.seed
        )
        bias = scores.mean(axis=0)
    else:
        known = setup.controller_is_known
        why = "flights simulated from the fit diverge" if known else "the controller is unknown"
        nulls = formula_nulls(fit, screen, why)
    return Step(fit, screen, screen.score(recorded, prior=True), nulls, bias)


def fit_with_cause(setup: Setup, current: CorrectedFit, choice: Choice) -> CorrectedFit:
    """Return the ``current`` fit with the chosen term, bias-corrected.

    A ``formal`` term only changes the form of the rigid body's equations, such as by omitting
    couplings. If the chosen term is ``formal``, all other significant ``formal`` candidates of the
    step are added too.
    """
    best = choice.candidates[0]
    problem, optimum = best.problem, best.optimum
    if best.term.effect.formal:
        also = [c for c in choice.candidates[1:] if is_significant_form(c, choice)]
        problem, optimum = with_forms(problem, optimum, also)
    return bias_corrected(setup, problem, optimum, current)


def is_significant_form(other: CandidateFit, choice: Choice) -> bool:
    """Return whether ``other`` is a ``formal`` candidate, and significant.

    ``formal`` candidates only change the form of the rigid body's equations. ``other`` is
    significant if two numbers reach ``choice.threshold``. The first is Z², the statistic of the
    score test. The second is the score, the gain in BIC by a refit with ``other``.
    """
    return other.term.effect.formal and min(other.statistic, other.score) >= choice.threshold


def with_forms(
    problem: Likelihood, optimum: Optimum, others: Sequence[CandidateFit]
) -> tuple[Likelihood, Optimum]:
    """Return the likelihood with the terms of ``others`` added, and its new optimum."""
    theta = optimum.theta
    for c in others:
        problem = problem.with_term(c.term)
        theta = np.append(theta, c.optimum.theta[-1])
    if not others:
        return problem, optimum
    return problem, maximise_corrected(problem, theta, optimum.noise, None)


def bias_corrected(
    setup: Setup, problem: Likelihood, optimum: Optimum, current: CorrectedFit | None = None
) -> CorrectedFit:
    """Return the fit near an optimum, bias-corrected if the controller is known.

    ``current``: the fit without the optimum's new terms. It provides a second starting point
    (`correction_starts`). On a limit cycle, a second fit also matches edge rates (how often encoder
    counts change); the fit with the smaller `unexplained_scatter` is returned. If the fit gives an
    implausible inertia, it is repeated with a narrow prior on the inertias.
    """

    def corrected(p: Likelihood) -> CorrectedFit:
        if not setup.controller_is_known:
            return CorrectedFit(p, maximise_corrected(p, optimum.theta, optimum.noise, None))
        fit = correct(
            p, correction_starts(optimum, current), setup.recordings, seed=setup.seed,
            flights_per_round=setup.flights_per_round, rounds=4,
        )  # fmt: skip
        if not fit.is_corrected or not scatters_on_limit_cycle(fit):
            return fit
        # `fit` holds the noise of axes with a limit cycle at that of a fit without the last cause.
        # That noise may be too large.
        again = fit_with_edge_rates(p, fit, setup.recordings, seed=setup.seed)
        return min(fit, again, key=lambda f: f.unexplained_scatter)

    return with_plausible_inertias(problem, corrected)


@lru_cache(maxsize=8)
def without(fit: CorrectedFit, name: str) -> CorrectedFit:
    """Return the fit without the term ``name``, refitted with the bias correction of ``fit``.

    If the correction is invalid for the refit (`out_of_range`), the refit is repeated without
    correction; its ``bias`` is zero.
    """
    keep = np.array([f.term != name for f in fit.free])
    structure = Structure(
        fit.structure.profile, tuple(t for t in fit.structure.terms if t.name != name)
    )
    problem = replace(fit.problem, structure=structure)
    return with_plausible_inertias(problem, lambda p: _refit(fit, keep, p))


def _refit(fit: CorrectedFit, keep: np.ndarray, problem: Likelihood) -> CorrectedFit:
    """Return a refit after some parameters of ``fit`` were removed; ``problem`` has the others.

    ``keep`` (n,) bool: True for each parameter of ``fit`` that ``problem`` still has. The refit
    starts at their values in ``fit``.
    """
    theta, noise = fit.optimum.theta[keep], fit.optimum.noise
    bias = fit.score_bias[keep]
    noise_bias = np.zeros(3) if fit.noise_bias is None else fit.noise_bias
    refit = maximise_corrected(problem, theta, noise, ScoreBias(bias, noise_bias, theta, noise))
    if out_of_range(fit, keep, refit):
        bias, noise_bias = np.zeros(len(theta)), np.zeros(3)
        refit = maximise_corrected(problem, theta, noise, None)
    C = fit.score_covariance
    C = None if C is None else C[np.ix_(keep, keep)]
    return CorrectedFit(problem, refit, C, bias, noise_bias, fit.flights)


def base_with_forms(base: CorrectedFit, fit: CorrectedFit) -> CorrectedFit:
    """Return a fit without the causes, but with the same form of the equations as in ``fit``.

    ``base`` is the fit of the model to which the search adds causes. ``fit`` contains the added
    causes. It may also contain terms that only change the form of the rigid body's equations
    (`Effect.formal`). Without such terms, the result is ``base``. Otherwise the function removes
    the causes from ``fit`` and refits the other terms.
    """
    if not fit.structure.formal:
        return base
    base_terms = {t.name for t in base.structure.terms}
    for t in fit.structure.terms:
        if t.name not in base_terms and not t.effect.formal:
            fit = without(fit, t.name)
    return fit


def out_of_range(fit: CorrectedFit, keep: np.ndarray, refit: Optimum) -> bool:
    """Return True if the bias correction of ``fit`` is invalid for ``refit``.

    It is invalid if the parameters differ by more than `MAX_SHIFT` standard deviations, or the
    noise intensities by more than `MAX_NOISE_SHIFT` in logarithm. ``keep`` (n,), bool: the
    parameters of ``fit`` that ``refit`` has.
    """
    o = fit.optimum
    A = o.information + np.diag(fit.problem.prior_precision)
    sd = np.sqrt(np.diag(np.linalg.inv(A)))[keep]
    noise_shift = np.abs(np.log(refit.noise[:3] / o.noise[:3]))[fit.problem.data.axes]
    shift = np.abs(refit.theta - o.theta[keep]) / sd
    return bool(shift.max() > MAX_SHIFT or noise_shift.max(initial=0.0) > MAX_NOISE_SHIFT)
