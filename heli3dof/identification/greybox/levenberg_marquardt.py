"""Levenberg's descent of residuals beside a prior, within bounds; with few or many tangents.

    Q(z) = r(z)ᵀ r(z) + (z − z_0)ᵀ Λ (z − z_0),      D = ∂r/∂z by differences,  (dim, R)

`descend` takes D anew in every round: dim evaluations of r for each step. `follow_on` starts near
a minimum, with the tangents of a problem next to it (some rows fewer, a term fewer), and lets every
evaluation mend them, with d the step and w = diag(D Dᵀ + Λ) d (Broyden):

    D ← D + w (r(z + d) − r(z) − Dᵀ d)ᵀ / (wᵀ d)

so that D predicts the step that was just made. D is taken anew only where a step that it proposed
was worth less than half, or more than one and a half times, what it promised.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

TRIES = 8
DAMPING = 1e-3
FRESH = 2
"""How often `follow_on` may take D anew."""
ENOUGH = 30
"""Evaluations in which it ends, differences aside."""
KEPT = 0.5
"""Of what was promised."""
Residuals = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Valley:
    """What is minimised, and where one may walk."""

    residuals: Residuals
    centre: np.ndarray
    """z_0 (dim,)"""
    prior: np.ndarray
    """Λ (dim, dim)"""
    low: np.ndarray
    high: np.ndarray
    difference: float
    """Step of the differences"""
    many: Any = map
    """As `map`, perhaps in threads"""

    def cost(self, r: np.ndarray, z: np.ndarray) -> float:
        d = z - self.centre
        return float(r @ r + d @ self.prior @ d)

    def tangents(self, z: np.ndarray, r: np.ndarray, which: np.ndarray | None = None) -> np.ndarray:
        """(len(which), R) rows of D, all where none are named."""
        side = np.where(z + self.difference < self.high, self.difference, -self.difference)
        j = np.arange(len(z)) if which is None else which
        moved = list(self.many(self.residuals, [z + side * (np.arange(len(z)) == i) for i in j]))
        return np.asarray((np.array(moved).reshape(len(j), len(r)) - r) / side[j, None])

    def step(self, z: np.ndarray, g: np.ndarray, H: np.ndarray, damping: float) -> np.ndarray:
        """Where that step leads; what would leave the bounds stops there, and the rest knows."""
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
class Reached:
    """Where a descent ended."""

    z: np.ndarray
    cost: float
    begun: float
    """The cost at its start"""
    tangents: np.ndarray
    """(dim, R), of the last round"""
    rounds: int
    settled: bool


def descend(
    v: Valley, z: np.ndarray, *, rounds: int, settled: float,
    say: Callable[[int, float, float], None] | None = None,
) -> Reached:  # fmt: skip
    """To where a round gains less than ``settled``; ``say(round, cost at the start, cost)``."""
    r = v.residuals(z)
    here = begun = v.cost(r, z)
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
        if say is not None:
            say(count, begun, here)
        if gain < settled:
            done = True
            break
    return Reached(z, here, begun, D, count, done)


def follow_on(
    v: Valley, z: np.ndarray, tangents: np.ndarray | None, *, settled: float, share: float = 0.0,
    enough: int = ENOUGH, fresh: int = FRESH,
) -> Reached:  # fmt: skip
    """To where a step promises less than ``settled``; rows of ``tangents`` that are NaN are taken
    anew, all where there are none."""
    r = v.residuals(z)
    here = begun = v.cost(r, z)
    D = np.full((len(z), len(r)), np.nan) if tangents is None else tangents.copy()
    lacking = np.flatnonzero(np.isnan(D).any(axis=1))
    if len(lacking):
        D[lacking] = v.tangents(z, r, lacking)
    damping, doubted, failed, done, count = DAMPING, False, 0, False, 0
    while count < enough:
        count += 1
        g, H = D @ r + v.prior @ (z - v.centre), D @ D.T + v.prior
        new = v.step(z, g, H, damping)
        d = new - z
        promised = here - v.cost(r + d @ D, new)
        if promised < max(settled, share * here) or failed > TRIES:
            if not (doubted and fresh):
                done = failed <= TRIES
                break
            fresh, doubted, failed, damping = fresh - 1, False, 0, DAMPING
            D = v.tangents(z, r)
            continue
        q = v.residuals(new)
        there = v.cost(q, new)
        won = here - there
        doubted |= abs(won - promised) > KEPT * promised
        w = np.diag(H) * d
        D = D + np.outer(w, q - r - d @ D) / (w @ d)
        if won > 0:
            z, r, here, failed = new, q, there, 0
            damping = max(damping / 10, 1e-6)
        else:
            failed, damping = failed + 1, damping * 10
            if failed > 1 and fresh:
                fresh, doubted, failed, damping = fresh - 1, False, 0, DAMPING
                D = v.tangents(z, r)
    return Reached(z, here, begun, D, count, done)
