"""Recommend the plan that determines in least time the parameters that a free-run fit left open.

The fit's parameters θ (n,) have the information H = D Dᵀ + Λ, with the derivatives D of its
residuals and the prior's precision Λ (`heli3dof.identification.greybox.multistep`). Each plan is
simulated on the fitted model with noise, encoders and the default controller. The residuals of this
flight, with the scales of the real fit, have derivatives D_p. Some parameters have a value of their
own in each recording. The prior couples the new recording's values b to the common ones by Λ_b:

    H_p = D_p D_pᵀ + Λ_b = [[A, B], [Bᵀ, C]],      σ_after² = diag [(H_now + A − B C⁻¹ Bᵀ)⁻¹]

A is the block of the common parameters, C that of b. H_now is the recordings' information on the
common parameters. An open parameter θ was not confirmed by the recordings, so only the information
of the new flight counts. θ_0 is the value of θ without the effect. The expected significance u of θ
in the new flight, and the probability P that θ is significant there, are

    u² = (θ − θ_0)² (1/σ_after² − 1/σ_now²),      P = Φ(u − `QUANTILE_975`)

Plans are ranked by the mean of P over the open parameters, per second of flight. A parameter on
which the recordings have little information is assumed to have at least its ``typical`` size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.constants import MAX_COMPARED, QUANTILE_975
from heli3dof.diagnosis.free_run.elimination import NORMAL
from heli3dof.diagnosis.free_run.refits import least_squares
from heli3dof.diagnosis.planning.plan_flights import flights_needed, fly_task, is_stable, task_of
from heli3dof.diagnosis.result import (
    MIN_CERTAINTY,
    NextExperiment,
    PlanForecast,
    UndecidedTerms,
    percent,
)
from heli3dof.errors import RecordingError
from heli3dof.experiment.plan import Plan, load_plan, named_plans
from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.multistep import MultiStep, MultiStepFit
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.parallel import parallel_map


@dataclass(frozen=True)
class OpenParameter:
    """The parameter of a term on which the planned flight should decide.

    It is the term's first parameter that all recordings share and that has no logarithmic scale.

    ``size``: distance from the value without the effect; ``size`` and ``std`` are in ``unit``.
    ``index``: of the scaled parameter; ``slope``: derivative of the value by the scaled one.
    """

    name: str
    index: int
    size: float
    std: float
    slope: float
    unit: str

    def margin(self, after: float) -> float:
        """Return the evidence u² expected of a flight that lowers σ = ``std`` to ``after``."""
        return self.size**2 * max(after**-2 - self.std**-2, 0.0)


def open_parameters(open_: UndecidedTerms) -> list[OpenParameter]:
    """Return at most `MAX_COMPARED` parameters; each represents an undecided term."""
    fit, out = open_.fit, []
    for name in open_.names:
        for j, f in enumerate(fit.structure.free):
            if f.term == name and f.name not in fit.problem.varying and not f.log:
                size, slope = abs(float(fit.values[j]) - f.null), float(fit.slopes[j])
                if fit.mostly_prior[j]:
                    size = max(size, f.typical)
                out.append(OpenParameter(name, j, size, float(fit.std[j]), slope, f.unit))
                break
    return out[:MAX_COMPARED]


def next_free_flight(
    open_: UndecidedTerms, model: GreyBoxModel, *, plans: Sequence[str] | None = None, seed: int = 0
) -> NextExperiment | None:
    """Return the recommended plan; None if no term is undecided or no plan is feasible.

    ``model``: the fitted model, to be simulated. ``plans``: names of the plans to compare; by
    default all.
    """
    parameters = open_parameters(open_)
    if not parameters or not is_stable(model):
        return None
    loaded = [load_plan(p) for p in (named_plans() if plans is None else plans)]
    H = marginal(open_.fit.information, open_.fit.problem.n)

    def std_after(i: int) -> np.ndarray | None:
        A = information(open_.fit, model, loaded[i], seed)
        return None if A is None else np.sqrt(np.diag(np.linalg.inv(H + A)))

    deviations = parallel_map(std_after, len(loaded), what="plans")
    outlooks = []
    for plan, s in zip(loaded, deviations, strict=True):
        if s is not None:
            margins = tuple(w.margin(s[w.index] * w.slope) for w in parameters)
            outlooks.append(PlanForecast(plan.name, plan.duration_s, margins, _certainty(margins)))
    if not outlooks:
        return None
    ranking = sorted(outlooks, key=lambda o: -o.certainty / o.duration_s)
    best = ranking[0]
    return NextExperiment(
        best.plan, tuple(open_.names if open_.tied else [w.name for w in parameters]),
        _why(best, parameters, open_.tied), round(best.certainty, 3),
        tuple(ranking),
    )  # fmt: skip


def why_none(open_: UndecidedTerms | None) -> str:
    """Return the reason why `next_free_flight` recommends no plan or was not called."""
    if open_ is None:
        return "the extended model was not adopted, so there is no model to simulate plans on"
    if not open_parameters(open_):
        return "no open parameter can be estimated by a plan"
    return "no plan is feasible on the fitted model with the default controller"


def probability_significant(margin: float) -> float:
    """Return the probability that a parameter with the expected evidence u² is significant.

    >>> p = probability_significant
    >>> round(p(1.96**2), 2), round(p(16.0), 2)
    (0.5, 0.98)
    """
    return NORMAL.cdf(math.sqrt(margin) - QUANTILE_975)


def information(fit: MultiStepFit, model: GreyBoxModel, plan: Plan, seed: int) -> np.ndarray | None:
    """Return the information (n, n) of a flight of ``plan`` on parameters shared by recordings.

    The flight is simulated. The result is None if the flight is not feasible.
    """
    task = task_of(plan, model.profile, seed)
    flight = None if task is None else fly_task(task, model)
    if flight is None:
        return None
    try:
        p = problem_of([flight], [t.name for t in fit.structure.terms])
    except RecordingError:
        return None
    z = np.concatenate([fit.theta, fit.theta[p.own]])
    # Neighbouring windows overlap almost completely, so every other window suffices.
    p = replace(p, flights=tuple(replace(f, starts=f.starts[::2]) for f in p.flights))
    v = least_squares(fit, p)
    D = v.tangents(z, v.residuals(z))
    return marginal(D @ D.T + coupling(p), p.n)


def marginal(H: np.ndarray, n: int) -> np.ndarray:
    """Return the information (n, n) on the first n parameters, marginal over the others.

    >>> marginal(np.array([[2.0, 1.0], [1.0, 1.0]]), 1)
    array([[1.]])
    """
    A, B, C = H[:n, :n], H[:n, n:], H[n:, n:]
    return np.asarray(A - B @ np.linalg.solve(C, B.T))


def coupling(p: MultiStep) -> np.ndarray:
    """Return Λ_b (dim, dim), which couples the recordings' own values to common parameters.

    It is the prior's precision minus that of the common parameters alone.
    """
    L = p.prior.copy()
    L[: p.n, : p.n] -= replace(p, flights=(), data=()).prior
    return L


def _why(best: PlanForecast, parameters: Sequence[OpenParameter], tied: bool) -> str:
    each = ", ".join(
        f"{w.name} with a probability of {percent(probability_significant(m))} "
        f"(if its size is {f'{w.size:.2g} {w.unit}'.removesuffix(' –')})"
        for w, m in zip(parameters, best.margins, strict=True)
    )
    text = "these causes are confounded; " if tied else ""
    text += (
        f"in simulation with the fitted model and the default controller, {best.duration_s:.0f} s "
        f"of this plan find {each}"
    )
    if best.certainty < MIN_CERTAINTY:
        text += f". {flights_needed(lambda flights: _certainty(best.margins, flights))}"
    return text


def _certainty(margins: Sequence[float], flights: int = 1) -> float:
    """Return the mean probability that the parameters are significant after some flights.

    ``margins``: u² of one flight for each parameter; those of several flights add.
    """
    return float(np.mean([probability_significant(flights * m) for m in margins]))
