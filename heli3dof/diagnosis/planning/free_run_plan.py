"""Which plan to fly next where no likelihood was fitted: the one that sizes what is open soonest.

A fit to free flights has the information H = D Dᵀ + Λ of its numbers θ (D the tangents of its
residuals, Λ the priors; `heli3dof.identification.greybox.multistep`). Each plan is flown on the
fitted rig, with its process noise and encoders, by the default controller (the rig's own is not
known); free flights of that recording, weighed by the scales of the *real* ones, have tangents D_p.
A new recording has numbers b of its own, tied to the common ones by Λ_b alone, so

    H_p = D_p D_pᵀ + Λ_b = [[A, B], [Bᵀ, C]],      σ_after² = diag (C_now⁻¹ + A − B C⁻¹ Bᵀ)⁻¹

What is open was not shown by each half of the recordings, so a flight has to show it by itself: a
term of size θ, whose absence is θ_0, with

    u² = (θ − θ_0)² (1/σ_after² − 1/σ_now²),      P = Φ(u − `SURE`)

and plans are ranked by the mean of P over what is open, per second. A term that the recordings say
nothing of counts with the size that matters on such a rig (its ``typical`` one).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.free_run.refits import STAGE_S
from heli3dof.diagnosis.outlook import HOPELESS, NextExperiment, Open, Outlook, percent
from heli3dof.diagnosis.planning.plan_flights import fly_task, stable, task_of
from heli3dof.errors import RecordingError
from heli3dof.experiment.plan import Plan, load_plan, named_plans
from heli3dof.identification.greybox.freeflight import problem_of
from heli3dof.identification.greybox.multistep import MultiStep, MultiStepFit, least_squares_problem
from heli3dof.parallel import parallel_map

SURE = 1.96
MOST = 3
"""Open terms that are asked for at once."""


@dataclass(frozen=True)
class Wanted:
    """The first number of a term: its place, its distance from absence and its σ, in ``unit``."""

    name: str
    at: int
    size: float
    std: float
    slope: float
    unit: str

    def shown(self, after: float) -> float:
        """u of a flight that brings σ to ``after``."""
        return self.size * math.sqrt(max(after**-2 - self.std**-2, 0.0))


def wanted(open_: Open) -> list[Wanted]:
    """The open terms' numbers that a flight can tell: not those that differ by recording."""
    fit, out = open_.fit, []
    for name in open_.names:
        for j, f in enumerate(fit.structure.free):
            if f.term == name and f.name not in fit.problem.varying and not f.log:
                size, slope = abs(float(fit.values[j]) - f.null), float(fit.slopes[j])
                if fit.std[j] > 0.7 * fit.prior_std[j]:  # its prior says so
                    size = max(size, f.typical)
                out.append(Wanted(name, j, size, float(fit.std[j]), slope, f.unit))
                break
    return out[:MOST]


def next_free_flight(
    open_: Open, *, plans: Sequence[str] | None = None, seed: int = 0
) -> NextExperiment | None:
    """The plan; None where nothing is open, or where no plan can be flown on the fitted rig."""
    asked, profile = wanted(open_), open_.model.profile
    if not asked or not stable(open_.model, profile):
        return None
    wished = [load_plan(p) for p in (named_plans() if plans is None else plans)]
    H = np.linalg.inv(_common(open_.fit))

    def one(i: int) -> np.ndarray | None:
        A = information(open_, wished[i], seed)
        return None if A is None else np.sqrt(np.diag(np.linalg.inv(H + A)))

    seen = parallel_map(one, len(wished), what="plans")
    told = {
        plan.name: (plan.duration_s, [w.shown(s[w.at] * w.slope) for w in asked])
        for plan, s in zip(wished, seen, strict=True)
        if s is not None
    }
    if not told:
        return None
    outlooks = (
        Outlook(name, T, tuple(x**2 for x in u), float(np.mean([chance(x) for x in u])))
        for name, (T, u) in told.items()
    )
    ranking = sorted(outlooks, key=lambda o: -o.certainty / o.duration_s)
    best = ranking[0]
    return NextExperiment(
        best.plan, tuple(open_.names if open_.tied else [w.name for w in asked]),
        _why(best, asked, open_.tied), round(best.certainty, 3),
        tuple(ranking),
    )  # fmt: skip


def why_none(open_: Open | None) -> str:
    """Where `next_free_flight` has nothing to recommend, or was not asked."""
    if open_ is None:
        return "the extended model was not adopted, so there is no model to simulate plans on"
    if not wanted(open_):
        return "no open parameter can be estimated by a plan"
    return "no plan is feasible on the fitted model with the default controller"


def chance(u: float) -> float:
    """That a number u deviations from its absence is told from it.

    >>> round(chance(1.96), 2), round(chance(4.0), 2)
    (0.5, 0.98)
    """
    return 0.5 * (1 + math.erf((u - SURE) / math.sqrt(2)))


def information(open_: Open, plan: Plan, seed: int) -> np.ndarray | None:
    """(n, n) what a flight of the plan says of the common numbers; None where none can be flown."""
    fit = open_.fit
    task = task_of(plan, open_.model.profile, seed)
    flight = None if task is None else fly_task(task, open_.model)
    if flight is None:
        return None
    try:
        p = problem_of([flight], [t.name for t in fit.structure.terms])
    except RecordingError:
        return None
    z = np.concatenate([fit.theta, fit.theta[p.own]])
    # Neighbouring windows share nearly everything: every other one says as much.
    p = replace(p, flights=tuple(replace(f, starts=f.starts[::2]) for f in p.flights))
    v = least_squares_problem(p, fit.noise, STAGE_S, fit.scale)
    D = v.tangents(z, v.residuals(z))
    return marginal(D @ D.T + link(p), p.n)


def marginal(H: np.ndarray, n: int) -> np.ndarray:
    """(n, n) the information on the first n numbers, whatever the others are.

    >>> marginal(np.array([[2.0, 1.0], [1.0, 1.0]]), 1)
    array([[1.]])
    """
    A, B, C = H[:n, :n], H[:n, n:], H[n:, n:]
    return np.asarray(A - B @ np.linalg.solve(C, B.T)) if len(C) else A


def link(p: MultiStep) -> np.ndarray:
    """(dim, dim) Λ_b: what ties a recording's own numbers to the common ones, and no more."""
    L = p.prior.copy()
    L[: p.n, : p.n] -= replace(p, flights=(), data=(), rows=()).prior
    return L


def _common(fit: MultiStepFit) -> np.ndarray:
    """(n, n) covariance of the common coordinates."""
    H = fit.tangents @ fit.tangents.T + fit.problem.prior
    return np.asarray(np.linalg.inv(H)[: fit.problem.n, : fit.problem.n])


def _why(best: Outlook, asked: Sequence[Wanted], tied: bool) -> str:
    each = ", ".join(
        f"{w.name} ({w.size:.2g} {w.unit}, probability {percent(chance(math.sqrt(m)))})"
        for w, m in zip(asked, best.margins, strict=True)
    )
    text = "these causes are confounded; " if tied else ""
    text += (
        f"in simulation with the fitted model and the default controller, {best.duration_s:.0f} s "
        f"of it identify {each}"
    )
    if best.certainty < HOPELESS:
        return f"{text}: more per second than any other plan, but hardly enough; repeat it"
    return text
