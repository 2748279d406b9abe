"""Recommend the plan that separates confounded causes in the shortest time.

Causes are confounded if they explain the recordings almost equally well. A plan separates them if
a flight of it shows which cause the rig has. To predict this, each plan is simulated once for each
cause i: in closed loop with noise and encoders, on a model that contains cause i. The plan is also
simulated on the base model, which contains none of these causes. The size of a cause is its
estimate or, without an estimate, a typical value.

The score test (`search.score_test`) computes a statistic of each cause j for each flight. z_j is
the statistic in the flight with cause i, minus the statistic in the flight without causes. z_j² is
about twice the increase in log-likelihood that cause j gives to the model. If the test evaluates a
cause at several sizes, its largest z_j² counts. So cause i is expected to be ahead of the best
other cause by the margin

    m_i = z_i² − max_{j≠i} z_j²,        m_i = z_i² if there is no other cause

The margin of the plan is the smallest m_i. Plans are ranked by margin/duration.

On a real flight, the margin varies at random. For two causes of known sizes, it is normal with the
mean m_i and the variance 4 m_i. The flight decides in favour of cause i if the margin exceeds
`TIE`. The certainty is the probability of this decision, averaged over the causes:

    certainty = mean_i Φ((m_i − TIE) / (2 √m_i)),        Φ counts as 0 if m_i ≤ 0
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import NormalDist

import numpy as np

from heli3dof.diagnosis.conclusion.confounded_parameters import separable_by_flight
from heli3dof.diagnosis.constants import MAX_CAUSES, TIE
from heli3dof.diagnosis.planning.free_run_plan import next_free_flight
from heli3dof.diagnosis.planning.plan_flights import (
    RenderedPlan,
    flights_needed,
    is_stable,
    rendered_plan,
    simulated_plan,
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
from heli3dof.identification.bias_correction.correction import model_at
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import term
from heli3dof.model.estimation.filter_data import data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.parallel import parallel_map


def fitted_cause(candidate: CandidateFit) -> Probe:
    """Return the candidate's term, with the values of its parameters from the candidate's refit.

    The refit adds the term to the model and estimates all parameters.
    """
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


def recommend(
    base: Estimate,
    causes: Sequence[Probe],
    *,
    plans: Sequence[str] | None = None,
    seed: int = 0,
) -> NextExperiment:
    """Return the plan that separates the ``causes`` in the shortest time.

    ``base``: a fit without these causes. ``plans``: names of the plans to compare; by default all.
    Each plan is simulated on the model of ``base``, and on this model with each cause added. Raises
    UsageError if no plan stays inside the safety envelope on all models, or if the controller does
    not stabilise one of them.
    """
    causes = list(causes)[:MAX_CAUSES]
    names = [c.term.name for c in causes]
    V = base.problem.data.V
    groups = [[*probes(c.term, V), c] for c in causes]
    profile = base.structure.profile
    o = base.optimum
    with_causes = (with_term_at(base.problem, o.theta, c.term, c.values) for c in causes)
    models = [model_at(*x, o.noise) for x in ((base.problem, o.theta), *with_causes)]
    rendered = []
    if all(map(is_stable, models)):
        loaded = [load_plan(p) for p in (named_plans() if plans is None else plans)]
        every = (rendered_plan(plan, profile, seed) for plan in loaded)
        rendered = [p for p in every if p is not None]
    forecasts = _forecasts(base, rendered, models, groups)
    if not forecasts:
        raise UsageError(
            f"No plan separates {', '.join(names)} on this rig.",
            cause="every plan leaves the envelope of this profile on at least one of the models.",
            fix="widen [limits] in the profile, or write a gentler plan",
        )
    ranking = tuple(sorted(forecasts, key=lambda f: -f.margin / f.duration_s))
    best = ranking[0]
    return NextExperiment(
        best.plan, tuple(names), _why(best, names), round(best.certainty, 3), ranking
    )


def next_experiment(found: Diagnosis, *, seed: int = 0) -> NextExperiment | None:
    """Return the flight plan that should answer an open question of the diagnosis ``found``.

    The function takes the first question in this list that is open:

    1. The diagnosis used free-run predictions: does the rig have the terms that they left
       undecided (`planning.free_run_plan`)?
    2. A finding is confounded with causes that a flight can separate: which does the rig have?
    3. The search selected a cause that held-out data do not confirm: does the rig have it?
    4. The recordings cannot show an effect, even if it is large: does the rig have it?

    Questions 3 and 4 are open only if the diagnosis has no findings. In addition, a base parameter
    (thrust gain, trim torque or inertia) that deviates from the profile must not be confounded with
    another cause. The result is None if no question is open, or if no plan is feasible. For
    questions 3 and 4, it is also None if a flight of the plan would decide with a probability below
    `MIN_CERTAINTY`.
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
        recommended = recommend(base, open_[:1], seed=seed)
        if (recommended.certainty or 0.0) < MIN_CERTAINTY:
            return None
        return replace(recommended, why=f"{recommended.why}, {known}")
    except UsageError:
        return None


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


def _probability_decided(margin: float) -> float:
    """Return the probability that a flight decides between causes: P(X > `TIE`).

    X ~ N(m, 4 m) is the evidence for the true cause against the best other cause, in units of
    2 ln L (L: likelihood). m = ``margin`` is its expected value; for m ≤ 0 the result is 0.

    >>> p = _probability_decided
    >>> p(6.0), round(p(30.0), 3), p(-1.0)
    (0.5, 0.986, 0.0)
    """
    return 1 - NormalDist(margin, 2 * math.sqrt(margin)).cdf(TIE) if margin > 0 else 0.0


def _forecasts(
    base: Estimate,
    plans: Sequence[RenderedPlan],
    models: Sequence[GreyBoxModel],
    groups: Sequence[Sequence[Probe]],
) -> list[PlanForecast]:
    """Return, for each feasible plan, how well it is expected to separate the causes.

    ``models``: the base model without the causes, then one model for each cause, which contains it.
    A plan is feasible if its simulated flight stays inside the safety envelope on each model.
    ``groups``: for each cause, the trial sizes at which the score test evaluates it.
    """
    n, flat = len(models), [p for group in groups for p in group]
    starts = np.cumsum([0, *map(len, groups[:-1])])
    z = parallel_map(lambda k: _scores(base, plans[k // n], models[k % n], flat), n * len(plans))
    out = []
    for i, p in enumerate(plans):
        scores = [x for x in z[n * i : n * (i + 1)] if x is not None]
        if len(scores) == n:
            without, *with_cause = scores
            margins = tuple(_margin(x - without, j, starts) for j, x in enumerate(with_cause))
            certainty = float(np.mean([_probability_decided(m) for m in margins]))
            out.append(PlanForecast(p.plan.name, p.plan.duration_s, margins, certainty))
    return out


def _scores(
    base: Estimate, plan: RenderedPlan, model: GreyBoxModel, probes: Sequence[Probe]
) -> np.ndarray | None:
    """Return the score-test statistics z (P,) of P trial effects ``probes`` for a simulated flight.

    The flight of ``plan`` is simulated on ``model``. The null hypothesis of the test is the model
    of the fit ``base``, with the fitted parameters: the rig has none of the trial effects. The
    result is None if the flight leaves the safety envelope or has no usable rows.
    """
    flight = simulated_plan(plan, model)
    if flight is None or not (runs := usable_runs(flight, 0)):
        return None
    problem = replace(base.problem, data=data_of([flight], runs))
    optimum = base.optimum
    evaluation = evaluate(problem, optimum.theta, optimum.noise, with_noise_derivatives=False)
    return Screen(problem, optimum.theta, evaluation, probes).score(evaluation, prior=False).z


def _margin(z: np.ndarray, i: int, starts: np.ndarray) -> float:
    """Return the largest z² of cause ``i`` minus the largest z² of the other causes.

    ``z`` (P,) contains the score-test statistics of all causes, each at several trial sizes, for a
    flight simulated with cause ``i``. ``starts``: index in ``z`` of each cause's first trial size.
    """
    highest = np.maximum.reduceat(z**2, starts)
    return float(highest[i] - np.delete(highest, i).max(initial=0.0))
