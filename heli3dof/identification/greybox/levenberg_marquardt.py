"""Minimise a sum of squares with a prior, within bounds, by the Levenberg–Marquardt method.

    Q(z) = r(z)ᵀ r(z) + (z − z_0)ᵀ Λ (z − z_0),      D = ∂r/∂z by differences,  (dim, R)

r (R,) are the residuals, z (dim,) the unknowns; z_0 is the prior mean, Λ (dim, dim) the prior's
precision. There are two searches. `descend` computes D in every iteration, which takes dim
evaluations of r. `follow_on` starts near a minimum, with the derivatives D of a similar problem,
for example one without the last unknown. It updates D after every evaluation (Broyden's method).
With the step d and w = diag(D Dᵀ + Λ) d:

    D ← D + w (r(z + d) − r(z) − Dᵀ d)ᵀ / (wᵀ d)

`follow_on` recomputes D by differences after two failed steps in a row. It also does so at the
minimum, if D predicted the decrease of Q poorly. That is, a step since the last computation lowered
Q by less than 0.5 or more than 1.5 times the predicted decrease.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from heli3dof.parallel import parallel_map

TRIES = 8
"""Largest number of failed steps in a row; after each one, the damping is ten times larger"""
DAMPING = 1e-3
"""Initial damping factor, relative to the diagonal of the Hessian"""
FRESH = 2
"""Number of times that `follow_on` may recompute the derivatives D by differences"""
MAX_EVALUATIONS = 30
"""Largest number of evaluations of the residuals in `follow_on`, those for differences excluded"""
MISMATCH = 0.5
"""Relative difference of a step's actual from its predicted cost reduction, above which `follow_on`
recomputes the derivatives D before it ends"""
Residuals = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """A least-squares problem: R residuals r(z) of the unknowns z (dim,), prior and bounds of z."""

    residuals: Residuals
    centre: np.ndarray
    """(dim,) mean z_0 of the prior of z"""
    prior: np.ndarray
    """(dim, dim) precision Λ (inverse covariance) of the prior of z"""
    low: np.ndarray
    high: np.ndarray
    difference: float
    """Step in z of the finite differences for ∂r/∂z"""

    def cost(self, r: np.ndarray, z: np.ndarray) -> float:
        d = z - self.centre
        return float(r @ r + d @ self.prior @ d)

    def tangents(self, z: np.ndarray, r: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """Return the derivatives ∂r/∂z at z (dim,) by finite differences, a row per unknown.

        ``r`` (R,) are the residuals at z. ``which`` lists the indices of the unknowns (None: all).
        """
        side = np.where(z + self.difference < self.high, self.difference, -self.difference)
        j = np.arange(len(z)) if which is None else which
        points = [z + side * (np.arange(len(z)) == i) for i in j]
        moved = parallel_map(lambda k: self.residuals(points[k]), len(points))
        return np.asarray((np.array(moved).reshape(len(j), len(r)) - r) / side[j, None])

    def step(self, z: np.ndarray, g: np.ndarray, H: np.ndarray, damping: float) -> np.ndarray:
        """Return z (dim,) after a Levenberg–Marquardt step with gradient g and Hessian H.

        H is increased by ``damping`` times its diagonal. An unknown that reaches a bound stays on
        it, and the step of the other unknowns is computed again.
        """
        A = H + damping * np.diag(np.diag(H))
        stopped = ((z <= self.low) & (g > 0)) | ((z >= self.high) & (g < 0))
        d = np.zeros(len(z))
        while not stopped.all():
            go = ~stopped
            d[go] = -np.linalg.solve(A[np.ix_(go, go)], (g + A @ np.where(stopped, d, 0.0))[go])
            there = np.clip(z + d, self.low, self.high)
            over = go & (there != z + d)
            if not over.any():
                break
            d[over] = (there - z)[over]
            stopped |= over
        return np.asarray(np.clip(z + d, self.low, self.high))


@dataclass(frozen=True, eq=False)
class Descent:
    """The result of `descend` or `follow_on`: the unknowns ``z`` at the minimum, and their cost."""

    z: np.ndarray
    cost: float
    tangents: np.ndarray
    """(dim, R) derivatives of the residuals in the last iteration"""
    rounds: int
    settled: bool
    """True if the search converged"""


def descend(
    v: LeastSquares, z: np.ndarray, *, rounds: int, settled: float,
    progress: Callable[[int, float, float], None] | None = None,
) -> Descent:  # fmt: skip
    """Return the unknowns that minimise the cost of problem v; the search starts at ``z`` (dim,).

    The search ends when an iteration lowers the cost by less than ``settled``, or after ``rounds``
    iterations. After iteration i it calls ``progress(i, start_cost, cost)``. ``start_cost`` is the
    cost at the start of the search, ``cost`` the cost after iteration i.
    """
    r = v.residuals(z)
    here = start_cost = v.cost(r, z)
    damping, done, count = DAMPING, False, 0
    D = np.zeros((len(z), len(r)))
    for count in range(1, rounds + 1):
        D = v.tangents(z, r)
        g, H = D @ r + v.prior @ (z - v.centre), D @ D.T + v.prior
        gain = 0.0
        for _ in range(TRIES):
            new = v.step(z, g, H, damping)
            q = v.residuals(new)
            if (there := v.cost(q, new)) < here:
                gain, z, r, here = here - there, new, q, there
                damping = max(damping / 10, 1e-6)
                break
            damping *= 10
        if progress is not None:
            progress(count, start_cost, here)
        if gain < settled:
            done = True
            break
    return Descent(z, here, D, count, done)


def follow_on(
    v: LeastSquares, z: np.ndarray, tangents: np.ndarray | None, *, settled: float,
    share: float = 0.0, max_evaluations: int = MAX_EVALUATIONS, fresh: int = FRESH,
) -> Descent:  # fmt: skip
    """Return the unknowns that minimise the cost of problem v, with updated derivatives ∂r/∂z.

    The search starts at ``z`` (dim,). ``tangents`` (dim, R) are the derivatives ∂r/∂z of a similar
    problem's residuals. Rows that are NaN, or all if ``tangents`` is None, are first computed by
    differences. The derivatives are recomputed at most ``fresh`` times. The search ends when the
    predicted decrease of the cost is below ``settled`` or ``share`` · cost, or after
    ``max_evaluations`` evaluations of the residuals.
    """
    r = v.residuals(z)
    here = v.cost(r, z)
    D = np.full((len(z), len(r)), np.nan) if tangents is None else tangents.copy()
    lacking = np.flatnonzero(np.isnan(D).any(axis=1))
    if len(lacking):
        D[lacking] = v.tangents(z, r, lacking)
    damping, doubted, failed, done, count = DAMPING, False, 0, False, 0
    while count < max_evaluations:
        count += 1
        g, H = D @ r + v.prior @ (z - v.centre), D @ D.T + v.prior
        new = v.step(z, g, H, damping)
        d = new - z
        predicted = here - v.cost(r + d @ D, new)
        if predicted < max(settled, share * here) or failed > TRIES:
            if not (doubted and fresh):
                done = failed <= TRIES
                break
            fresh, doubted, failed, damping = fresh - 1, False, 0, DAMPING
            D = v.tangents(z, r)
            continue
        q = v.residuals(new)
        there = v.cost(q, new)
        actual = here - there
        doubted |= abs(actual - predicted) > MISMATCH * predicted
        w = np.diag(H) * d
        D = D + np.outer(w, q - r - d @ D) / (w @ d)
        if actual > 0:
            z, r, here, failed = new, q, there, 0
            damping = max(damping / 10, 1e-6)
        else:
            failed, damping = failed + 1, damping * 10
            if failed > 1 and fresh:
                fresh, doubted, failed, damping = fresh - 1, False, 0, DAMPING
                D = v.tangents(z, r)
    return Descent(z, here, D, count, done)
