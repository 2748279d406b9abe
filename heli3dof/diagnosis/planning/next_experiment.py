"""Recommend the plan that separates the confounded causes in the shortest time.

For each cause i, every plan is simulated in closed loop on the base model with this cause at its
estimated size, with noise and encoders. The score test (`search.score_test`) gives the score of
each cause j. z_j is this score minus that on a flight simulated without these causes:

    margin_i = z_i² − max_{j≠i} z_j²,      margin = min_i margin_i

For a single cause, margin = z². Plans are ranked by margin/duration. z² is twice the increase in
log-likelihood by a cause. So for two simple hypotheses with the expected margin m, the margin of a
real flight has the distribution N(m, 4 m). The certainty is the probability that this margin
exceeds the margin m_0 that a decision requires (by default `TIE`). It is averaged over the causes i
with the expected margins m_i:

    certainty = mean_i Φ((m_i − m_0) / (2 √m_i))
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import NormalDist

import numpy as np

from heli3dof.diagnosis.conclusion.confounded_parameters import separable_by_flight
from heli3dof.diagnosis.constants import MAX_CAUSES, SUFFICIENT, TIE
from heli3dof.diagnosis.planning.free_run_plan import next_free_flight
from heli3dof.diagnosis.planning.plan_flights import (
    Task,
    flights_needed,
    fly_task,
    is_stable,
    task_of,
)
from heli3dof.diagnosis.result import (
    DOES_NOT_PAY,
    MIN_CERTAINTY,
    Diagnosis,
    NextExperiment,
    PlanForecast,
    percent,
)
from heli3dof.diagnosis.search.candidate_fits import CandidateFit, with_term_at
from heli3dof.diagnosis.search.catalogue import Probe, probes
from heli3dof.diagnosis.search.score_test import Screen
from heli3dof.errors import UsageError
from heli3dof.experiment.plan import load_plan, named_plans
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import model_at
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import term
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.parallel import parallel_map


def fitted_cause(candidate: CandidateFit) -> Probe:
    """Return the candidate's term with the values of its full fit."""
    values = candidate.problem.values(candidate.optimum.theta)
    own = values[-len(candidate.term.effect.parameters) :]
    return Probe(candidate.term, tuple(map(float, own)))


def typical_cause(name: str) -> Probe:
    """Return the term ``name`` with values of its parameters at which it has a typical effect.

    The first parameter has the start value of a fit. If the effect is absent at this value, the
    parameter's typical size is added, or subtracted if the sum would reach the upper bound. The
    other parameters have their typical values.
    """
    t = term(name)
    first, *rest = t.effect.parameters
    size = first.start
    if size == first.null:
        size += first.typical if size + first.typical < first.high else -first.typical
    return Probe(t, (size, *(p.typical for p in rest)))


def likely_cause(base: Estimate, name: str) -> Probe:
    """Return the term ``name`` with the parameter values of a refit of ``base`` with this term."""
    t = term(name)
    o = base.optimum
    problem, start = with_term_at(base.problem, o.theta, t, typical_cause(name).values)
    refit = maximise_corrected(problem, start, o.noise, None)
    own = problem.values(refit.theta)[-len(t.effect.parameters) :]
    return Probe(t, tuple(map(float, own)))


def recommend(
    base: Estimate,
    causes: Sequence[Probe],
    *,
    plans: Sequence[str] | None = None,
    seed: int = 0,
    decisive: float = TIE,
) -> NextExperiment:
    """Return the plan that distinguishes the confounded causes in the shortest time.

    ``base``: a fit without these causes. ``plans``: names of the plans to compare; by default all.
    ``decisive``: the margin that a decision requires.
    Raises UsageError if each plan leaves the safety envelope or is unstable on at least one model.
    """
    causes = list(causes)[:MAX_CAUSES]
    names = [c.term.name for c in causes]
    V = base.problem.data.V
    groups = [[*probes(c.term, V), c] for c in causes]
    profile = base.structure.profile
    o = base.optimum
    with_causes = (with_term_at(base.problem, o.theta, c.term, c.values) for c in causes)
    models = [model_at(*x, o.noise) for x in ((base.problem, o.theta), *with_causes)]
    tasks = []
    if all(map(is_stable, models)):
        loaded = [load_plan(p) for p in (named_plans() if plans is None else plans)]
        tasks = [t for t in (task_of(plan, profile, seed) for plan in loaded) if t is not None]
    outlooks = _outlooks(base, tasks, models, groups, decisive)
    if not outlooks:
        raise UsageError(
            f"No plan separates {', '.join(names)} on this rig.",
            cause="every plan leaves the envelope of this profile on at least one of the models.",
            fix="widen [limits] in the profile, or write a gentler plan",
        )
    ranking = tuple(sorted(outlooks, key=lambda o: -o.margin / o.duration_s))
    best = ranking[0]
    return NextExperiment(
        best.plan, tuple(names), _why(best, names), round(best.certainty, 3), ranking
    )


def next_experiment(found: Diagnosis, *, seed: int = 0) -> NextExperiment | None:
    """Return the recommended experiment for the first of these that a diagnosis has, or None:

    1. the terms that a fit to free-run predictions left undecided (`planning.free_run_plan`)
    2. the first finding with confounded causes that a flight can separate
    3. an effect that a residual torque resembles (`Diagnosis.likely_effects`)
    4. without findings: a cause that held-out data do not confirm
    5. without findings: an effect that the recordings could not show

    For 3 to 5, the result is None if its certainty is below `MIN_CERTAINTY`. For 4 and 5, it is
    also None if a base parameter off nominal is confounded with other causes.
    """
    if found.fitted is not None and found.fitted.open is not None:
        return next_free_flight(found.fitted.open, found.fitted.model, seed=seed)
    if found.fitted is None or found.fitted.base is None:
        return None
    base: Estimate = found.fitted.base
    try:
        for finding in found.findings:
            best, *others = finding.choice.candidates
            if names := separable_by_flight(finding.term.name, finding.tied_with):
                tied = [c for c in others if c.term.name in names]
                return recommend(base, [fitted_cause(c) for c in (best, *tied)], seed=seed)
            base = Estimate(best.problem, best.optimum)
        if found.likely_effects:
            likely = likely_cause(base, found.likely_effects[0])
            decisive = SUFFICIENT if found.findings else TIE
            known = "which would explain the residual torque of these recordings"
            return _if_certain(recommend(base, [likely], seed=seed, decisive=decisive), known)
        known = f"which fits these recordings better, but {DOES_NOT_PAY}"
        open_ = [
            typical_cause(x.name) if x.choice is None else fitted_cause(x.choice.candidates[0])
            for x in found.dropped
            if x.why == DOES_NOT_PAY
        ]
        if not open_:
            known = "which these recordings cannot show, even if it is large"
            hidden = separable_by_flight("", found.not_identifiable)
            open_ = [typical_cause(name) for name in hidden[:1]]
        if found.findings or any(o.tied_with for o in found.calibration_findings) or not open_:
            return None
        return _if_certain(recommend(base, open_[:1], seed=seed), known)
    except UsageError:
        return None


def _if_certain(recommended: NextExperiment, known: str) -> NextExperiment | None:
    """Return the recommendation, with ``known`` added to its reason; None if too uncertain.

    ``known`` is a clause on the cause: what the recordings show of it.
    """
    if (recommended.certainty or 0.0) < MIN_CERTAINTY:
        return None
    return replace(recommended, why=f"{recommended.why}, {known}")


def _why(best: PlanForecast, names: Sequence[str]) -> str:
    seconds = f"{best.duration_s:.0f} s"
    if len(names) == 1:
        return (
            f"in simulation, {seconds} of this plan decide with a probability of "
            f"{percent(best.certainty)} whether the rig has {names[0]}"
        )
    what = " and ".join(names) if len(names) == 2 else ", ".join(names)
    if best.certainty < MIN_CERTAINTY:
        return (
            f"no plan separates {what} well. In simulation, {seconds} of this plan do so by a "
            f"margin of {best.margin:.0f}, more than any other plan. "
            + flights_needed(lambda flights: _probability_decided(flights * best.margin))
        )
    return (
        f"in simulation, {seconds} of this plan separate {what} by a margin of {best.margin:.0f} "
        f"({percent(best.certainty)} probability of a decision)"
    )


def _probability_decided(margin: float, decisive: float = TIE) -> float:
    """Return the probability of a decision, P(X > ``decisive``) for X ~ N(margin, 4 margin).

    >>> p = _probability_decided
    >>> p(6.0), round(p(30.0), 3), p(-1.0)
    (0.5, 0.986, 0.0)
    """
    return 1 - NormalDist(margin, 2 * math.sqrt(margin)).cdf(decisive) if margin > 0 else 0.0


def _outlooks(
    base: Estimate,
    tasks: Sequence[Task],
    models: Sequence[GreyBoxModel],
    groups: Sequence[Sequence[Probe]],
    decisive: float,
) -> list[PlanForecast]:
    """Return the forecasts of the plans that all ``models`` can fly.

    ``models``: the base model, then one with each cause. ``groups``: for each cause, the trial
    sizes at which the score test evaluates it. ``decisive``: the margin that a decision requires.
    """
    n, flat = len(models), [p for group in groups for p in group]
    starts = np.cumsum([0, *map(len, groups[:-1])])
    z = parallel_map(lambda k: _scores(base, tasks[k // n], models[k % n], flat), n * len(tasks))
    out = []
    for i, task in enumerate(tasks):
        scores = [x for x in z[n * i : n * (i + 1)] if x is not None]
        if len(scores) == n:
            without, *with_cause = scores
            margins = tuple(_margin(x - without, j, starts) for j, x in enumerate(with_cause))
            certainty = float(np.mean([_probability_decided(m, decisive) for m in margins]))
            out.append(PlanForecast(task.plan.name, task.plan.duration_s, margins, certainty))
    return out


def _scores(
    base: Estimate, task: Task, model: GreyBoxModel, probes: Sequence[Probe]
) -> np.ndarray | None:
    """Return the score-test statistics z (P,) of P trial effects on a simulated flight.

    The result is None if the flight is not feasible or has no usable rows.
    """
    flight = fly_task(task, model)
    if flight is None or not (runs := usable_runs(flight, 0)):
        return None
    problem = replace(base.problem, data=data_of([flight], runs))
    optimum = base.optimum
    evaluation = evaluate(problem, optimum.theta, optimum.noise, with_noise_derivatives=False)
    return Screen(problem, optimum.theta, evaluation, probes).score(evaluation, prior=False).z


def _margin(z: np.ndarray, i: int, starts: np.ndarray) -> float:
    """Return the largest z² of cause ``i`` minus the largest z² of the other causes.

    ``z`` (P,): score-test statistics of P trial sizes of the causes, on a flight simulated with
    cause ``i``. ``starts``: index in ``z`` of each cause's first trial size.
    """
    highest = np.maximum.reduceat(z**2, starts)
    return float(highest[i] - np.delete(highest, i).max(initial=0.0))
