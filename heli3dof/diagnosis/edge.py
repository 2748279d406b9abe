"""Whether the recordings refute a rig that stands on the tolerance's edge: a score test, twice.

A parameter is accused by its estimate, one solution of the estimating equation of
`heli3dof.diagnosis.corrected`. Where encoders chatter that equation has others, or hardly tells a
ridge of less inertia and more noise from the rig that flew; flights of a known rig, estimated
again, show nothing of that. So the recordings themselves are asked. With parameter j pinned to the
edge, everything else (o) estimated beside it, and that rig flown b = 1 … B times,

    T = g_j − H_jo (H_oo + Λ_oo)⁻¹ g_o,      z = ± (T − mean T_b) / (s √(1 + 1/B))

is Lagrange's multiplier: how surely the recordings want j to move from there (+: on, to the
estimate). The edge is refuted where z is beyond Student's quantile for what is found from the
estimate's own noise on the axis of j, and for what is found from much less. And the estimate must
fly as the recordings do (`heli3dof.diagnosis.alike`): where its flights chatter faster on that axis
it is the wrong end of the ridge, and accuses nobody; where they chatter slower, those of the edge
must not come nearer.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.diagnosis.alike import against, rates_apart, widest
from heli3dof.diagnosis.calibration import quantile
from heli3dof.diagnosis.corrected import Corrected, Informed, correct, fly_again, look, model_at
from heli3dof.diagnosis.steps import Bench
from heli3dof.diagnosis.workers import in_threads

PILOTS = 6
ROUNDS = 10
FLIGHTS = 24
SHARES = (1.0, 0.3)
"""Of the estimate's noise on the parameter's axis, from which the edge is solved"""
NEARER = 1.0
"""Standard deviations by which flights of the edge are more like the recordings"""
FIRM = 1e-4
"""Standard deviation of a pinned coordinate."""


@dataclass(frozen=True, eq=False)
class Pinned(Informed):
    """The likelihood with coordinate ``which`` held at ``at``, by a prior that allows no other."""

    which: int = 0
    at: float = 0.0

    @cached_property
    def prior_mean(self) -> np.ndarray:
        """(n,) coordinates"""
        mean = np.array([f.inward(f.start) for f in self.structure.free])
        mean[self.which] = self.at
        return mean

    @cached_property
    def prior_precision(self) -> np.ndarray:
        """(n,)"""
        precision = np.array(Informed.prior_precision.func(self))  # type: ignore[attr-defined]
        precision[self.which] = 1 / FIRM**2
        return precision


def refuted(bench: Bench, found: Corrected, j: int, value: float) -> bool:
    """Whether no rig whose parameter j, an inertia, is ``value`` (in the fit's units) explains the
    recordings of which ``found`` is the estimate. Where the first does not settle: no; a second
    that is still on its way is asked all the same."""

    def apart(rig: Corrected) -> float:
        return float(rates_apart(rig, bench.recordings, seed=bench.seed)[j - 1])

    slower = apart(found)
    if slower < -widest():
        return False
    for share in SHARES:
        there = on_the_edge(bench, found, j, value, share)
        settled = there.optimum.converged or share != SHARES[0]
        if there.scatter is None or not settled:
            return False
        if slower > widest() and abs(apart(there)) < slower - NEARER:
            return False
        if multiplier(bench, found, there, j) < quantile(FLIGHTS - 1):
            return False
    return True


def on_the_edge(bench: Bench, found: Corrected, j: int, value: float, share: float) -> Corrected:
    """Everything else estimated beside parameter j pinned, from ``share`` of its axis' noise."""
    problem, f = found.problem, found.free[j]
    pinned = Pinned(
        problem.data, problem.structure, problem.noise_steps, which=j, at=f.inward(value)
    )
    theta, noise = found.theta.copy(), found.optimum.noise.copy()
    theta[j] = pinned.at
    noise[j - 1] *= share
    return correct(
        pinned, theta, noise, bench.recordings, seed=bench.seed, pilots=PILOTS, rounds=ROUNDS
    )


def multiplier(bench: Bench, found: Corrected, there: Corrected, j: int) -> float:
    """z of coordinate j at ``there``, where it is pinned; positive: on towards ``found``."""
    problem, o = found.problem, there.optimum
    model = model_at(problem, o.theta, o.noise)

    def flight(b: int) -> tuple[np.ndarray, np.ndarray]:
        data = fly_again(model, bench.recordings, problem.data, (bench.seed, 13, b))
        seen = look(replace(problem, data=data), o.theta, o.noise, whole=False)
        return seen.g, seen.H

    flown = in_threads(flight, FLIGHTS, what="flights")
    H = np.mean([h for _, h in flown], axis=0)
    precision = problem.prior_precision
    T = efficient(np.array([g for g, _ in flown]), H, precision, j)
    here = look(problem, o.theta, o.noise, whole=False)
    z = against(efficient(here.g[None], H, precision, j), T[:, None])
    return float(z[0] * np.sign(found.theta[j] - o.theta[j]))


def efficient(g: np.ndarray, H: np.ndarray, precision: np.ndarray, j: int) -> np.ndarray:
    """(B,) T of scores g (B, n): that of j once the others have given way.

    >>> H = np.array([[4.0, 2.0], [2.0, 4.0]])
    >>> efficient(np.array([[1.0, 4.0]]), H, np.zeros(2), 0)
    array([-1.])
    """
    other = np.arange(len(H)) != j
    A = H[np.ix_(other, other)] + np.diag(precision[other])
    return np.asarray(g[:, j] - g[:, other] @ np.linalg.solve(A, H[other, j]))
