"""Recommend the plan that separates confounded causes in the shortest time.

Causes are confounded if they explain the recordings almost equally well. A flight separates them if
its diagnosis shows which cause the rig has. To predict this, B = `FLIGHTS` flights of each plan are
simulated for each cause i. They are simulated in closed loop, with noise and encoder rounding, on
the base model plus cause i. Cause i has its fitted size. If it was not fitted to the recordings, it
has a typical size.

Several models are fitted to each simulated flight (`search.candidate_fits`): the base model, and
the base model plus one cause k, for each k. The score s_k is the gain in BIC if cause k is added to
the base model:

    s_k = 2 (ℓ_k − ℓ_0) − m_k ln N

- ℓ_0, ℓ_k: maximum log-likelihood of the base model, and of the base model plus cause k
- m_k: number of parameters of cause k
- N: number of measurement updates of the Kalman filter

The base model itself counts as k = 0, with s_0 = 0. The margin of a flight is the score of the true
cause i, minus the best other score. Means over the B flights with the true cause i give the score
S_i and the margin M_i:

    S_i = mean s_i,      M_i = mean (s_i − max_{k≠i} s_k)

A diagnosis ignores small differences of scores, because chance or an inexact formula may cause them
(`select.least_difference`). So the plan is expected to identify cause i if M_i exceeds the limit
D_i:

    M_i > D_i,      D_i = max(`TIE`, `FORMULA_ERROR` S_i)

A plan may test whether the rig has a further cause, in addition to those already found. D_i is then
at least `SUFFICIENT`. The margin of the plan is the smallest M_i. Plans are ranked by

    min_i (M_i − `FORMULA_ERROR` S_i)/duration

The certainty of the plan is the smallest probability, over all causes i, that one flight identifies
cause i if the rig has it (`_probability_decided`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from heli3dof.diagnosis.conclusion.confounded_parameters import separable_by_flight
from heli3dof.diagnosis.constants import MAX_CAUSES, SUFFICIENT, TIE
from heli3dof.diagnosis.planning.free_run_plan import next_free_flight
from heli3dof.diagnosis.planning.plan_flights import (
    LIKELY,
    MOST_FLIGHTS,
    RenderedPlan,
    flights_needed,
    flights_sentence,
    is_stable,
    rendered_plan,
    simulated_plan,
)
from heli3dof.diagnosis.result import (
    COLOURED,
    DOES_NOT_PAY,
    MIN_CERTAINTY,
    Diagnosis,
    NextExperiment,
    PlanForecast,
    percent,
)
from heli3dof.diagnosis.search.candidate_fits import (
    CandidateFit,
    bic_penalty,
    fit_start,
    refit_with_term,
    with_term_at,
)
from heli3dof.diagnosis.search.catalogue import Probe
from heli3dof.diagnosis.search.select import FORMULA_ERROR, least_difference
from heli3dof.errors import UsageError
from heli3dof.experiment.plan import load_plan, named_plans
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.correction import model_at
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import Term, term
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.parallel import parallel_map

FLIGHTS = 2
"""Simulated flights of each plan for each cause. Each costs a fit of each cause. Chosen."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A model with one cause or with none: its likelihood, its parameters and its noise."""

    problem: Likelihood
    theta: np.ndarray
    """(n,) scaled parameters"""
    noise: np.ndarray
    """(4,) process noise of three axes, jitter"""
    term: Term | None = None
    """The cause"""

    @property
    def model(self) -> GreyBoxModel:
        return model_at(self.problem, self.theta, self.noise)

    def fit(self, data: Data) -> Optimum:
        """Return the maximum-likelihood fit of this model to ``data``.

        The search for the maximum starts at the model's parameters and noise intensities. The
        model's cause, ``term``, may have a list of trial values for its first parameter
        (`Effect.starts`). This parameter then starts at the likeliest of these values.
        """
        problem, theta, noise = replace(self.problem, data=data), self.theta, self.noise
        if self.term is not None and self.term.effect.starts:
            n = len(theta) - len(self.term.effect.parameters)
            theta, noise = fit_start(problem, theta[:n], noise, self.term)
        return maximise_corrected(problem, theta, noise, None)


def hypothesis(base: Estimate, cause: Probe | CandidateFit) -> Hypothesis:
    """Return the model with a cause added to ``base``.

    If ``cause`` is a `CandidateFit`, the result is the model that this refit estimated. If
    ``cause`` is a `Probe` (a term with trial values), the term is added to ``base`` with these
    values.
    """
    o = base.optimum
    if isinstance(cause, CandidateFit):
        o = cause.optimum
        return Hypothesis(cause.problem, o.theta, o.noise, cause.term)
    problem, theta = with_term_at(base.problem, o.theta, cause.term, cause.values)
    return Hypothesis(problem, theta, o.noise, cause.term)


def fitted_cause(candidate: CandidateFit) -> Probe:
    """Return the candidate's term, with the values of its parameters from the candidate's refit.

    The refit adds the term to the model and estimates all parameters.
    """
    return _as_fitted(candidate.term, candidate.problem, candidate.optimum)


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
    typical = typical_cause(name)
    return _as_fitted(typical.term, *refit_with_term(base, typical.term, typical.values))


def _as_fitted(t: Term, problem: Likelihood, optimum: Optimum) -> Probe:
    """Return the term ``t`` with its values in a fit, which are the last parameters of the fit."""
    own = problem.values(optimum.theta)[-len(t.effect.parameters) :]
    return Probe(t, tuple(map(float, own)))


def recommend(
    base: Estimate,
    causes: Sequence[Probe | CandidateFit],
    *,
    plans: Sequence[str] | None = None,
    seed: int = 0,
    decisive: float = TIE,
) -> NextExperiment:
    """Return the plan that separates the ``causes`` in the shortest time.

    Its ``plan`` is None if not even `MOST_FLIGHTS` flights of the best plan separate them.

    ``base``: a fit without these causes. ``causes``: each element is a refit of ``base`` with one
    cause added, or trial values of the cause's parameters. ``plans``: names of the plans to
    compare; by default all.

    ``decisive``: a flight identifies the true cause if its score exceeds the best other score by at
    least ``decisive``. The score of a cause is its gain in BIC.

    Raises UsageError if no plan stays inside the safety envelope on all models, or if the
    controller does not stabilise one of the models.
    """
    causes = list(causes)[:MAX_CAUSES]
    names = [c.term.name for c in causes]
    profile, o = base.structure.profile, base.optimum
    without = Hypothesis(base.problem, o.theta, o.noise)
    with_cause = [hypothesis(base, c) for c in causes]
    rendered = []
    if all(is_stable(h.model) for h in (without, *with_cause)):
        loaded = [load_plan(p) for p in (named_plans() if plans is None else plans)]
        every = (rendered_plan(plan, profile, seed) for plan in loaded)
        rendered = [p for p in every if p is not None]
    forecasts = _forecasts(rendered, without, with_cause, decisive)
    if not forecasts:
        raise UsageError(
            f"No plan separates {', '.join(names)} on this rig.",
            cause="every plan leaves the envelope of this profile on at least one of the models.",
            fix="widen [limits] in the profile, or write a gentler plan",
        )
    ranking = tuple(sorted(forecasts, key=lambda f: -_beyond_formula_error(f) / f.duration_s))
    return _recommended(ranking, names, decisive)


def next_experiment(found: Diagnosis, *, seed: int | None = None) -> NextExperiment | None:
    """Return the flight plan that should answer an open question of the diagnosis ``found``.

    The function takes the first question in this list that is open:

    1. The diagnosis used free-run predictions: does the rig have the terms that they left
       undecided (`planning.free_run_plan`)?
    2. A finding is confounded with causes that a flight can separate: which does the rig have?
    3. A residual torque resembles an effect (`Diagnosis.likely_effects`): does the rig have it?
    4. The search selected a cause that held-out data do not confirm, or that low-frequency noise
       explains as well: does the rig have it?
    5. The recordings cannot show an effect, even if it is large: does the rig have it?

    Questions 4 and 5 are open only if the diagnosis has no findings. In addition, a base parameter
    (thrust gain, trim torque or inertia) that deviates from the profile must not be confounded with
    another cause. The result is None if no question is open, or if no plan is feasible. For
    questions 3 to 5, it is also None if a flight of the plan would decide with a probability below
    `MIN_CERTAINTY`.

    ``seed``: random seed of the simulated flights; by default that of the diagnosis. So
    ``heli3dof diagnose`` and ``run_auto`` recommend the same plan for the same diagnosis.
    """
    if seed is None:
        seed = int(found.about.get("seed", 0))
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
                return recommend(base, [best, *tied], seed=seed)
            base = Estimate(best.problem, best.optimum)
        if found.likely_effects:
            likely = likely_cause(base, found.likely_effects[0])
            decisive = SUFFICIENT if found.findings else TIE
            known = "which would explain the residual torque of these recordings"
            return _if_certain(recommend(base, [likely], seed=seed, decisive=decisive), known)
        dropped = [x for x in found.dropped if x.why in (DOES_NOT_PAY, COLOURED)]
        open_ = [
            typical_cause(x.name) if x.choice is None else fitted_cause(x.choice.candidates[0])
            for x in dropped
        ]
        if dropped:
            known = f"which fits these recordings better, but {dropped[0].why}"
        else:
            known = "which these recordings cannot show, even if it is large"
            hidden = separable_by_flight("", found.not_identifiable)
            open_ = [typical_cause(name) for name in hidden[:1]]
        if found.findings or any(o.tied_with for o in found.calibration_findings) or not open_:
            return None
        return _if_certain(recommend(base, open_[:1], seed=seed), known)
    except UsageError:
        return None


def _if_certain(recommended: NextExperiment, clause: str) -> NextExperiment | None:
    """Return the recommendation with ``clause`` added to its reason, or None.

    The recommended flight tests whether the rig has one particular cause. ``clause`` states what
    the recordings already show about this cause. The result is None if the test is too weak: if the
    rig has the cause, the flight detects it with a probability below `MIN_CERTAINTY`.
    """
    if (recommended.certainty or 0.0) < MIN_CERTAINTY:
        return None
    return replace(recommended, why=f"{recommended.why}, {clause}")


def _recommended(
    ranking: tuple[PlanForecast, ...], names: Sequence[str], decisive: float = TIE
) -> NextExperiment:
    best = ranking[0]
    flights = flights_needed(lambda flights: _certainty(best, decisive, flights))
    plan, why = None if flights is None else best.plan, _why(best, names, flights)
    return NextExperiment(plan, tuple(names), why, round(best.certainty, 3), ranking)


def _why(best: PlanForecast, names: Sequence[str], flights: int | None) -> str:
    seconds = f"{best.duration_s:.0f} s"
    if len(names) == 1:
        return (
            f"in simulation, {seconds} of this plan decide with a probability of "
            f"{percent(best.certainty)} whether the rig has {names[0]}"
        )
    what = " and ".join(names) if len(names) == 2 else ", ".join(names)
    if flights is None:
        return (
            f"no plan separates {what}: not even {MOST_FLIGHTS} flights of the best one, "
            f"{best.plan}, decide with a probability of {percent(LIKELY)}. "
            "Measure one effect by hand"
        )
    if best.certainty < MIN_CERTAINTY:
        return (
            f"no plan separates {what} well. In simulation, {seconds} of this plan do so by a "
            f"margin of {best.margin:.0f}, more than any other plan. {flights_sentence(flights)}"
        )
    return (
        f"in simulation, {seconds} of this plan separate {what} by a margin of {best.margin:.0f} "
        f"({percent(best.certainty)} probability of a decision)"
    )


def _certainty(f: PlanForecast, decisive: float, flights: int = 1) -> float:
    """Return the probability that ``flights`` flights of a plan identify the true cause.

    The probability depends on which cause is true. The function returns the smallest one.
    ``decisive``: as in `recommend`.
    """
    pairs = zip(f.margins, f.scores, strict=True)
    return min(_probability_decided(m, score, flights, decisive) for m, score in pairs)


def _probability_decided(
    margin: float, score: float, flights: int = 1, decisive: float = TIE
) -> float:
    """Return P(n), the probability that n ``flights`` of a plan identify the true cause.

    The score of a cause in a flight is the gain in BIC if this cause is added to the model. The
    margin of a flight is the score of the true cause, minus the best other score.

    - ``score``: S, the mean score of the true cause over B = `FLIGHTS` simulated flights
    - ``margin``: M, the mean margin over these flights

    Scores and margins add up over the n flights. The flights identify the true cause if the sum of
    their margins exceeds

        D = max(``decisive``, `TIE`, `FORMULA_ERROR` n S)

    For two causes of known sizes, the margin of one flight is normally distributed. Its variance is
    four times its mean. The sum of n margins is predicted as n M. This prediction has two
    independent errors:

    - The margins of the n flights scatter: variance 4 n M.
    - M is only the mean of B simulated flights: variance 4 n² M/B. This error limits P(n), even if
      n is large.

    So, with the normal distribution function Φ,

        P(n) = Φ((n M − D) / (2 √(n M + n² M/B))),        0 if M ≤ 0

    >>> p = _probability_decided
    >>> p(6.0, 50.0), round(p(30.0, 50.0), 3), p(-1.0, 50.0)
    (0.5, 0.963, 0.0)
    >>> round(p(0.3, 0.3, 20), 2), p(30.0, 1000.0, 20)
    (0.5, 0.5)
    """
    if margin <= 0:
        return 0.0
    m = flights * margin
    std = 2 * math.sqrt(m + flights * m / FLIGHTS)
    return 1 - NormalDist(m, std).cdf(max(decisive, least_difference(flights * score)))


def _beyond_formula_error(f: PlanForecast) -> float:
    """Return the smallest value of M − `FORMULA_ERROR` · S over the causes: a plan's safe margin.

    S is the expected score of a cause (gain in BIC) if this cause is the true one. M is S minus the
    best other score. Inexact formulas of effects may change the scores by `FORMULA_ERROR` · S.
    """
    return min(m - FORMULA_ERROR * s for m, s in zip(f.margins, f.scores, strict=True))


def _forecasts(
    plans: Sequence[RenderedPlan], without: Hypothesis, with_cause: Sequence[Hypothesis],
    decisive: float,
) -> list[PlanForecast]:  # fmt: skip
    """Return, for each feasible plan, how well it is expected to separate the causes.

    A plan is feasible if its simulated flights stay inside the safety envelope on each model. The
    score of a cause is its gain in BIC. A flight identifies the true cause if the score of this
    cause exceeds the best other score by at least ``decisive``. ``without``: the base model,
    without the causes. ``with_cause``: one model for each cause.
    """
    models = [without.model, *(h.model for h in with_cause)]
    numbers = [(0, 0), *((i + 1, b) for i in range(len(with_cause)) for b in range(FLIGHTS))]

    def scores(index: int) -> np.ndarray | None:
        p, (model, flight) = plans[index // len(numbers)], numbers[index % len(numbers)]
        flown = simulated_plan(p, models[model], flight)
        if flown is None or not (runs := usable_runs(flown, 0)):
            return None
        return _scores(data_of([flown], runs), without, with_cause) if model else np.zeros(1)

    every = parallel_map(scores, len(numbers) * len(plans), what="flights")
    out = []
    for k, p in enumerate(plans):
        S = [x for x in every[k * len(numbers) : (k + 1) * len(numbers)] if x is not None]
        if len(S) == len(numbers):
            by_cause = np.reshape(S[1:], (len(with_cause), FLIGHTS, len(with_cause) + 1))
            margins = tuple(
                float(np.mean(x[:, i] - np.delete(x, i, axis=1).max(axis=1)))
                for i, x in enumerate(by_cause)
            )
            own = tuple(float(x[:, i].mean()) for i, x in enumerate(by_cause))
            f = PlanForecast(p.plan.name, p.plan.duration_s, margins, 0.0, own)
            out.append(replace(f, certainty=_certainty(f, decisive)))
    return out


def _scores(data: Data, without: Hypothesis, with_cause: Sequence[Hypothesis]) -> np.ndarray | None:
    """Return the scores (K + 1,) of K causes and of the base model; None if a fit diverges.

    The simulated flight ``data`` is fitted with the base model (``without``), and with the base
    model plus each cause. The score of a cause is its gain in BIC over the base model. The last
    score is that of the base model itself, which is 0.
    """
    base = without.fit(data)
    out = []
    for h in with_cause:
        assert h.term is not None
        o = h.fit(data)
        m = 0 if h.term.effect.of_base else len(o.theta) - len(base.theta)
        # The model contains the base model, so it cannot be less likely.
        out.append(max(2 * (o.loglik - base.loglik), 0.0) - bic_penalty(m, base.at))
    return np.array([*out, 0.0]) if np.isfinite([base.loglik, *out]).all() else None
