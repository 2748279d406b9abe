"""Recommend the plan that tests the open parameters of a free-run fit in the shortest time.

A free-run fit minimises the errors of multi-step predictions
(`heli3dof.identification.greybox.multistep`). A parameter θ of an effect is open if the fit does
not show whether θ differs from θ_0, the value without the effect.

**Information before the flight.** The fit estimates n parameters, each with one value that is
common to all recordings. Some of them also have a separate value in each recording. The fit's
information matrix of all these values is D Dᵀ + Λ. D contains the derivatives of the fit's
residuals with respect to the values, and Λ is the precision matrix of the prior. H_now (n, n) is
the Schur complement that eliminates the separate values. So the common values have the variances
σ_now² = diag H_now⁻¹.

**Information after the flight.** Each plan is simulated on the fitted model with noise, encoders
and the default controller. The simulated flight has separate values b of its own. Their prior is a
normal distribution about the common values. Λ_b is its precision matrix, for the common values and
b together. D_p contains the derivatives of the simulated flight's residuals with respect to the
common values and b. (The residuals are prediction errors, weighted as in the fit.) Block A belongs
to the common values, block C to b:

    D_p D_pᵀ + Λ_b = [[A, B], [Bᵀ, C]],      σ_after² = diag [(H_now + A − B C⁻¹ Bᵀ)⁻¹]

**Ranking.** The old recordings did not show that θ differs from θ_0, so the new flight alone must
show it. Without the old recordings' information 1/σ_now², the information on θ after the flight is
1/σ_after² − 1/σ_now². θ is assumed to have the value that the fit estimates. Then θ − θ_0 is
expected to be u standard deviations. It is significant with the probability P:

    u² = (θ − θ_0)² (1/σ_after² − 1/σ_now²),      P = Φ(u − `QUANTILE_975`)

Plans are ranked by the mean of P over the open parameters, per second of flight. If the recordings
have little information on θ, |θ − θ_0| is taken as at least the typical size of the effect.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.constants import MAX_COMPARED, QUANTILE_975
from heli3dof.diagnosis.free_run.elimination import NORMAL
from heli3dof.diagnosis.free_run.refits import least_squares
from heli3dof.diagnosis.planning.plan_flights import (
    flights_needed,
    flights_sentence,
    is_stable,
    rendered_plan,
    simulated_plan,
)
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
    """A parameter of an effect; the planned flight should show whether the rig has the effect.

    It is the effect's first parameter that has the same value in all recordings and no logarithmic
    scale.
    """

    name: str
    """Name of the effect"""
    index: int
    """Index of the parameter among the fit's parameters"""
    size: float
    """Distance of the estimate from the parameter's value without the effect, in ``unit``"""
    std: float
    """Standard deviation of the estimate before the flight, in ``unit``"""
    slope: float
    """Derivative of the value in ``unit`` with respect to the scaled parameter of the fit"""
    unit: str

    def expected_chi2(self, std_after: float) -> float:
        """Return u² = (size/σ)²: the χ² that is expected from the planned flight alone.

        ``size`` is the parameter's distance from its value without the effect. The standard
        deviation of its estimate depends on the flights that are used: σ with the planned flight
        alone, ``std`` with the flights so far, and ``std_after`` with all of these. The information
        of the flights adds up, so 1/σ² = 1/``std_after``² − 1/``std``².
        """
        return self.size**2 * max(std_after**-2 - self.std**-2, 0.0)


def open_parameters(open_: UndecidedTerms) -> list[OpenParameter]:
    """Return one parameter for each undecided term, at most `MAX_COMPARED` parameters.

    A term is an effect on one axis. It is undecided if the recordings do not show whether the rig
    has this effect. A parameter is suitable if it has the same value in all recordings and no
    logarithmic scale. The function returns the first suitable parameter of each undecided term. It
    omits terms without a suitable parameter.
    """
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
    """Return the plan that shows in the shortest time whether the rig has the undecided effects.

    ``open_``: the undecided effects, and the fit that does not show whether the rig has them.
    ``model``: the fitted model, on which the plans are simulated. ``plans``: names of the plans to
    compare; by default all.

    The result is None in three cases:

    - No undecided effect has a parameter that a flight can test (`open_parameters`).
    - The default controller does not stabilise the model.
    - No plan is feasible.
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
    forecasts = []
    for plan, s in zip(loaded, deviations, strict=True):
        if s is not None:
            chi2 = tuple(w.expected_chi2(s[w.index] * w.slope) for w in parameters)
            forecasts.append(PlanForecast(plan.name, plan.duration_s, chi2, _certainty(chi2)))
    if not forecasts:
        return None
    ranking = sorted(forecasts, key=lambda f: -f.certainty / f.duration_s)
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


def probability_significant(chi2: float) -> float:
    """Return the probability that the estimate of a parameter is significant at 5 %.

    ``chi2`` = u²: the parameter's true distance from its value without the effect is u standard
    deviations.

    >>> p = probability_significant
    >>> round(p(1.96**2), 2), round(p(16.0), 2)
    (0.5, 0.98)
    """
    return NORMAL.cdf(math.sqrt(chi2) - QUANTILE_975)


def information(fit: MultiStepFit, model: GreyBoxModel, plan: Plan, seed: int) -> np.ndarray | None:
    """Return the information (n, n) that a flight of ``plan`` has on the n common parameters.

    The common parameters of ``fit`` are shared by all recordings. The flight is simulated on
    ``model``. The result is None if the plan fails a check, if the flight leaves the safety
    envelope, or if its recording cannot be used in a fit.
    """
    p = rendered_plan(plan, model.profile, seed)
    flight = None if p is None else simulated_plan(p, model)
    if flight is None:
        return None
    try:
        problem = problem_of([flight], [t.name for t in fit.structure.terms])
    except RecordingError:
        return None
    z = np.concatenate([fit.theta, fit.theta[problem.own]])
    # Neighbouring windows overlap almost completely, so every other window suffices.
    flights = tuple(replace(f, starts=f.starts[::2]) for f in problem.flights)
    problem = replace(problem, flights=flights)
    v = least_squares(fit, problem)
    D = v.tangents(z, v.residuals(z))
    return marginal(D @ D.T + coupling(problem), problem.n)


def marginal(H: np.ndarray, n: int) -> np.ndarray:
    """Return the information (n, n) on the first n parameters, if the others are unknown.

    It is the Schur complement of the others' block in the information matrix ``H`` of all
    parameters.

    >>> marginal(np.array([[2.0, 1.0], [1.0, 1.0]]), 1)
    array([[1.]])
    """
    A, B, C = H[:n, :n], H[:n, n:], H[n:, n:]
    return np.asarray(A - B @ np.linalg.solve(C, B.T))


def coupling(p: MultiStep) -> np.ndarray:
    """Return Λ_b (dim, dim): the precision matrix of separate values about the common values.

    ``p`` has dim unknowns: the common values of its parameters, and for some parameters also a
    separate value in each recording. The prior of a separate value is normal about the common
    value. The common values also have a prior of their own. Λ_b is the precision matrix of the
    whole prior without that part.
    """
    L = p.prior.copy()
    L[: p.n, : p.n] -= replace(p, flights=(), data=()).prior
    return L


def _why(best: PlanForecast, parameters: Sequence[OpenParameter], tied: bool) -> str:
    each = ", ".join(
        f"{w.name} with a probability of {percent(probability_significant(chi2))} "
        f"(if its size is {f'{w.size:.2g} {w.unit}'.removesuffix(' –')})"
        for w, chi2 in zip(parameters, best.margins, strict=True)
    )
    text = "these causes are confounded; " if tied else ""
    text += (
        f"in simulation with the fitted model and the default controller, {best.duration_s:.0f} s "
        f"of this plan find {each}"
    )
    if best.certainty < MIN_CERTAINTY:
        flights = flights_needed(lambda flights: _certainty(best.margins, flights))
        text += f". {flights_sentence(flights)}"
    return text


def _certainty(chi2: Sequence[float], flights: int = 1) -> float:
    """Return the probability that a parameter is significant after some flights of a plan.

    The result is the mean over the parameters. ``chi2``: u² (`OpenParameter.expected_chi2`) of each
    parameter for one flight. The u² of several flights add up.
    """
    return float(np.mean([probability_significant(flights * u2) for u2 in chi2]))
