"""Standardise the scores z of the score test by null simulations; compute the threshold of Z².

The score test (`search.score_test`) gives P scores z, one for each probe and each scan. A *probe*
is an effect with fixed trial values of its parameters (`search.catalogue`). A *scan* tests a torque
at every frequency or every start time; its z is the largest of these scores
(`bias_correction.scans`).

*Nulls* (null simulations) are B flights simulated from the fit, so without any further effect. They
have the recordings' references and controller. Their scores z_null contain the bias that encoder
quantisation and feedback cause. Each score z is standardised:

    Z = (z − mean z_null) / std z_null
    std² = max(s, 1)² + (`DRIFT` · mean z_null)²

- s² is the weighted mean of two numbers: the variance of the score over the nulls (weight B − 1),
  and the median of all P variances (weight `COMMON`). An exact likelihood has s = 1.
- The second summand allows for coloured noise of the rig, which changes the mean of z. It is
  omitted for a scan: the maximum of many scores has a positive mean even without bias.

Without any effect, Z/√(1 + 1/B) has Student's t distribution with ν = B − 1 + `COMMON` degrees of
freedom. t_ν(p) is the value that this t exceeds with probability p. Bonferroni's threshold is

    Z*² = (1 + 1/B) t_ν(FALSE_ALARMS / (2 P))²

If the rig has no effect, the largest of the P values Z² exceeds Z*² with a probability of at most
FALSE_ALARMS. With at least `GUMBEL_FROM` nulls, a Gumbel distribution is fitted to the largest Z²
of each null. It gives a second threshold with the same probability. The higher threshold is used.

There are no nulls if the controller is unknown, or if flights simulated from the fit diverge. Then
Z = z/√κ with the fit's variance inflation κ, and the threshold is twice Bonferroni's for a normal
distribution.

**Gumbel distribution**, fitted to maxima by the method of moments:

    Pr(x < X) = exp(−exp(−(X − μ)/β)),     β = √6 s_x/π,     μ = x̄ − γ β

x̄ and s_x are mean and standard deviation of the maxima x, γ is Euler's constant. A share α of all
maxima exceeds μ + k β with k = −ln(−ln(1 − α)).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.constants import DRIFT, FALSE_ALARMS
from heli3dof.diagnosis.search.catalogue import candidates
from heli3dof.diagnosis.search.score_test import Screen, ScreenResult
from heli3dof.distributions import chi2_isf, t_isf, t_sf
from heli3dof.identification.bias_correction.correction import (
    CorrectedFit,
    model_at,
    simulate_again,
)
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.model.effects import Term
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording

COMMON = 8
"""Weight of the median variance over all scores, in flights. Chosen; not derived."""
GUMBEL_FROM = 30
"""Fewest flights for a Gumbel fit. Chosen; not derived."""


@dataclass(frozen=True, eq=False)
class Nulls:
    """Distribution of the scores of P trial effects in flights without any effect.

    It is estimated from B simulated flights or, if none could be simulated, given by a formula.
    """

    mean: np.ndarray
    std: np.ndarray
    """(P,) each: mean and standard deviation of z over the nulls, by the module's equations"""
    inflation: float
    """κ ≥ 1, variance inflation: the median of all P values s². An exact likelihood has κ = 1."""
    threshold: float
    """Threshold of the largest Z²"""
    freedom: float
    """ν, Student's degrees of freedom"""
    flights: int
    """B, number of null simulations; 0 if a formula gives the distribution"""
    method: str

    def standardised(self, result: ScreenResult) -> np.ndarray:
        """Return the standardised scores Z (P,)."""
        return np.asarray((result.z - self.mean) / self.std)

    def threshold_of(self, term: Term) -> float:
        """Return the threshold of Z² for a term.

        A term is an effect on one axis. ``formal`` terms have a separate threshold: they only
        change the form of the rigid body's equations, such as by omitting couplings. Bonferroni's
        correction of this threshold counts only the ``formal`` terms of the catalogue.
        """
        if not term.effect.formal:
            return self.threshold
        forms = sum(other.effect.formal for other in candidates())
        spread = 1 + 1 / self.flights if self.flights else 2.0
        return float(spread * t_isf(FALSE_ALARMS / (2 * forms), self.freedom) ** 2)

    def confidence(self, Z2: float) -> float:
        """Return the probability exp(−P p) that none of P squared scores reaches Z² by chance.

        p is the probability that one squared score reaches Z² by chance.
        """
        spread = 1 + 1 / self.flights if self.flights else 2.0
        p = 2 * float(t_sf(np.sqrt(Z2 / spread), self.freedom))
        return float(np.exp(-len(self.mean) * p))


def simulated_nulls(
    fit: CorrectedFit,
    recordings: Sequence[Recording],
    screen: Screen,
    *,
    flights: int,
    seed: int,
) -> tuple[Nulls, np.ndarray]:
    """Return the distribution of the scores z in null simulations, and each flight's ∂ℓ/∂θ (B, n).

    The B = ``flights`` flights are simulated from ``fit``, without any further effect. ℓ is the
    log-likelihood, θ (n,) are the fit's scaled parameters. The controller must be known.
    """
    problem, o = fit.problem, fit.optimum
    model = model_at(problem, o.theta, o.noise)

    def one(b: int) -> tuple[np.ndarray, np.ndarray]:
        data = simulate_again(model, recordings, problem.data, (seed, 1, b))
        evaluation = evaluate(
            replace(problem, data=data), o.theta, o.noise, with_noise_derivatives=False
        )
        return screen.score(evaluation, prior=False).z, evaluation.g

    out = replicate(one, flights, what="flights")
    z = np.array([z for z, _ in out])
    return nulls_from_scores(z, len(screen.plain)), np.array([g for _, g in out])


def nulls_from_scores(z: np.ndarray, probes: int | None = None) -> Nulls:
    """Return the distribution of P scores from their values z (B, P) in B null simulations.

    The first ``probes`` scores (default: all) belong to effects with fixed trial values of their
    parameters. Each other score is the largest one of an effect over all frequencies or start
    times.
    """
    B, P = z.shape
    mean = z.mean(axis=0)
    std = _shrunk_std(z)
    inflation = float(np.median(std) ** 2)
    drift = np.where(np.arange(P) < (P if probes is None else probes), DRIFT * mean, 0.0)
    std = np.hypot(std, drift)
    nu = B - 1 + COMMON
    threshold = (1 + 1 / B) * float(t_isf(FALSE_ALARMS / (2 * P), nu)) ** 2
    others_mean = (z.sum(axis=0) - z) / (B - 1)
    largest = (((z - others_mean) / std) ** 2).max(axis=1)
    if B >= GUMBEL_FROM:
        mu, beta = gumbel(largest)
        threshold = max(threshold, mu + beta * gumbel_factor(FALSE_ALARMS))
    return Nulls(mean, std, inflation, threshold, nu, B, "simulated")


def _shrunk_std(z: np.ndarray) -> np.ndarray:
    var = z.var(axis=0, ddof=1)
    alive = var > 0
    common = float(np.median(var[alive])) if alive.any() else 1.0
    both = ((len(z) - 1) * var + COMMON * common) / (len(z) - 1 + COMMON)
    return np.asarray(np.maximum(np.sqrt(both), 1.0))


def bonferroni(tests: int) -> float:
    """Return Bonferroni's threshold of Z² for a number of ``tests``, for a normal distribution.

    Without any effect, the largest Z² of the tests exceeds it with probability `FALSE_ALARMS`.

    >>> round(bonferroni(60), 1)
    16.4
    """
    return float(chi2_isf(FALSE_ALARMS / tests, 1))


def formula_nulls(fit: CorrectedFit, screen: Screen, why: str) -> Nulls:
    """Return the distribution that the scores have without any effect, computed from a formula.

    ``why``: reason why null simulations cannot estimate it, for the text ``method``.
    """
    n = len(screen.names)
    root = float(np.sqrt(max(fit.inflation, 1.0)))
    return Nulls(
        np.zeros(n), np.full(n, root), root**2, 2 * bonferroni(n), 1e6, 0,
        f"Bonferroni over the scores, doubled: {why}",
    )  # fmt: skip


def gumbel(largest: np.ndarray, *, least: float = 0.0) -> tuple[float, float]:
    """Return (location μ, scale β) of the Gumbel distribution of maxima (B,); β ≥ ``least``."""
    beta = max(float(np.sqrt(6) * largest.std(ddof=1) / np.pi), least)
    return float(largest.mean()) - np.euler_gamma * beta, beta


def gumbel_factor(share: float) -> float:
    """Return k such that a ``share`` of Gumbel-distributed maxima exceeds μ + k β.

    μ and β are location and scale of the distribution.

    >>> round(gumbel_factor(0.0005), 2)
    7.6
    """
    return -math.log(-math.log(1 - share))
