"""Simulated nulls: the estimate flown as the recording was, and what the screen says of that.

B flights of the fitted rig (`estimate.simulated_flight`) are screened like the recording.
Each probe's z is then judged by its own nulls,

    Z = (z − mean z_null) / std z_null

so a cause that quantisation and feedback fake is not believed for what they fake. From B flights a
standard deviation is known to 1/√(2B); it is shrunk towards what all probes have in common (worth
`COMMON` flights) and never taken below 1, what an exact likelihood gives. A rig's noise is not the
flights' white one, so what the nulls say of a fake is itself known to a share `DRIFT` only:

    std² = max(shrunk, 1)² + (`DRIFT` · mean z_null)²

So Z follows, where
nothing is hidden, Student's t with B − 1 + `COMMON` degrees of freedom, × √(1 + 1/B); the largest
of P probes exceeds

    Z*² = (1 + 1/B) t²_{ν}(FALSE_ALARMS / 2P)

at most in a share `FALSE_ALARMS` of recordings (Bonferroni's bound, near enough: most probes
differ). Where the largest of the nulls themselves (each against the others) follow a Gumbel law
that puts it higher, that is the threshold. Where the loop is unknown no flight can be simulated:
z is divided by the root of the inflation, and the threshold is twice Bonferroni's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit, model_at, simulate_again
from heli3dof.diagnosis.estimate.evaluation import evaluate
from heli3dof.diagnosis.estimate.setup import FALSE_ALARMS
from heli3dof.diagnosis.screening.gumbel import beyond, gumbel
from heli3dof.diagnosis.screening.score_test import Screen, ScreenResult
from heli3dof.model.effects import Term
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

DRIFT = 0.25
WAYS = 2
"""What is ``formal`` in the catalogue, at one look"""
COMMON = 8
"""Flights that the probes' common standard deviation is worth."""
GUMBEL_FROM = 30
"""Flights from which on the nulls' own extremes are asked."""


@dataclass(frozen=True, eq=False)
class Nulls:
    """What the screen says where nothing is hidden: P probes, B flights (none: by formula)."""

    mean: np.ndarray
    std: np.ndarray
    """(P,), (P,)"""
    inflation: float
    """How much more than an exact likelihood's the scores scatter: the median, at least 1"""
    threshold: float
    """Of the largest Z²"""
    freedom: float
    """Student's ν"""
    flights: int
    method: str
    largest: np.ndarray = field(default_factory=lambda: np.zeros(0))
    """(B,) Z² of each null against the others"""

    def judged(self, seen: ScreenResult) -> np.ndarray:
        """(P,) Z."""
        return np.asarray((seen.z - self.mean) / self.std)

    def least(self, term: Term) -> float:
        """The Z² from which a term is there: the threshold; of the `WAYS` to write the body's
        equations, which accuse nobody, what the largest of so few exceeds by chance."""
        from scipy.stats import t

        if not term.effect.formal:
            return self.threshold
        spread = 1 + 1 / self.flights if self.flights else 2.0
        return float(spread * t.isf(FALSE_ALARMS / (2 * WAYS), self.freedom) ** 2)

    def confidence(self, Z2: float) -> float:
        """One less the chance that nothing gives as much."""
        from scipy.stats import t

        spread = 1 + 1 / self.flights if self.flights else 2.0
        p = 2 * float(t.sf(np.sqrt(Z2 / spread), self.freedom))
        return float(np.exp(-len(self.mean) * p))


def simulated_nulls(
    found: CorrectedFit,
    recordings: Sequence[Recording],
    screen: Screen,
    *,
    flights: int,
    seed: int,
) -> tuple[Nulls, np.ndarray]:
    """Nulls of recordings whose loop is known, and the scores (B, n) of the flights."""
    problem, o = found.problem, found.optimum
    model = model_at(problem, o.theta, o.noise)

    def one(b: int) -> tuple[np.ndarray, np.ndarray]:
        data = simulate_again(model, recordings, problem.data, (seed, 1, b))
        at = evaluate(replace(problem, data=data), o.theta, o.noise, whole=False)
        return screen.see(at, prior=False).z, at.g

    out = parallel_map(one, flights, what="flights")
    z = np.array([z for z, _ in out])
    return judged_by(z, len(screen.plain)), np.array([g for _, g in out])


def judged_by(z: np.ndarray, signed: int | None = None) -> Nulls:
    """The nulls of z (B, P), of which the first ``signed`` (all) are zero where nothing is false;
    the others are maxima."""
    from scipy.stats import t

    B, P = z.shape
    mean = z.mean(axis=0)
    std = _shrunk(z)
    inflation = float(np.median(std) ** 2)
    false = np.where(np.arange(P) < (P if signed is None else signed), DRIFT * mean, 0.0)
    std = np.hypot(std, false)
    nu = B - 1 + COMMON
    threshold = (1 + 1 / B) * float(t.isf(FALSE_ALARMS / (2 * P), nu)) ** 2
    rest = (z.sum(axis=0) - z) / (B - 1)
    largest = (((z - rest) / std) ** 2).max(axis=1)
    if B >= GUMBEL_FROM:
        mu, beta = gumbel(largest)
        threshold = max(threshold, mu + beta * beyond(FALSE_ALARMS))
    return Nulls(mean, std, inflation, threshold, nu, B, "simulated", largest)


def _shrunk(z: np.ndarray) -> np.ndarray:
    var = z.var(axis=0, ddof=1)
    alive = var > 0
    common = float(np.median(var[alive])) if alive.any() else 1.0
    both = ((len(z) - 1) * var + COMMON * common) / (len(z) - 1 + COMMON)
    return np.asarray(np.maximum(np.sqrt(both), 1.0))


def formula_nulls(found: CorrectedFit, screen: Screen) -> Nulls:
    """Without a loop to replay: Bonferroni over the probes, doubled; see the module."""
    from scipy.stats import chi2

    n = len(screen.names)
    root = float(np.sqrt(max(found.inflation, 1.0)))
    return Nulls(
        np.zeros(n), np.full(n, root), root**2, 2 * float(chi2.isf(FALSE_ALARMS / n, 1)), 1e6, 0,
        "Bonferroni over the probes, doubled: the loop is unknown",
    )  # fmt: skip
