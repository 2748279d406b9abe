"""Standardise the scores z of the score test by simulated nulls, and compute the threshold of Z².

A *probe* is an effect with trial values of its parameters (`search.catalogue`). A *scan* tests a
torque at all frequencies or instants, and its z is the largest (`bias_correction.scans`). There are
P scores z: one for each probe and each scan.

*Nulls* are B flights simulated from the fit, with the recordings' references and controller. Their
scores contain the bias that encoder quantisation and feedback cause. Each score z is standardised:

    Z = (z − mean z_null) / std z_null
    std² = max(s, 1)² + (`DRIFT` · mean z_null)²

- s² is the weighted mean of two variances over the nulls: that of the score itself (weight B − 1)
  and the median over all scores (weight `COMMON`). An exact likelihood has s = 1.
- The second summand allows for noise of the rig that is not white, and so changes the mean of z. A
  scan omits it: the mean of a largest z is positive even without bias.

Without any effect, Z/√(1 + 1/B) has Student's t distribution with ν = B − 1 + `COMMON` degrees of
freedom. t_ν(p) is the value that this t exceeds with probability p. Bonferroni's threshold is

    Z*² = (1 + 1/B) t_ν(FALSE_ALARMS / 2P)²

The largest of the P values Z² exceeds it in at most a share FALSE_ALARMS of recordings. With at
least `GUMBEL_FROM` nulls, a Gumbel distribution is fitted to the largest Z² of each null. Its
quantile for FALSE_ALARMS replaces Bonferroni's threshold if it is higher.

If the controller is unknown or flights simulated from the fit diverge, there are no nulls. Then
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
    """κ ≥ 1: the median over all scores of their variance; an exact likelihood has 1"""
    threshold: float
    """Threshold of the largest Z²"""
    freedom: float
    """ν, Student's degrees of freedom"""
    flights: int
    """B; 0 by formula"""
    method: str

    def standardised(self, result: ScreenResult) -> np.ndarray:
        """Return the standardised scores Z (P,)."""
        return np.asarray((result.z - self.mean) / self.std)

    def threshold_of(self, term: Term) -> float:
        """Return the threshold of a term's Z².

        Terms that only write the rigid body's equations in another form have a threshold of their
        own. Its Bonferroni correction counts only these terms of the catalogue.
        """
        if not term.effect.formal:
            return self.threshold
        forms = sum(other.effect.formal for other in candidates())
        spread = 1 + 1 / self.flights if self.flights else 2.0
        return float(spread * t_isf(FALSE_ALARMS / (2 * forms), self.freedom) ** 2)

    def confidence(self, Z2: float) -> float:
        """Return the probability exp(−P p) that none of P squared scores reaches Z² by chance.

        p is the probability that one squared score does.
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
    """Return the distribution of the scores z in simulated flights, and each flight's ∂ℓ/∂θ (B, n).

    B = ``flights`` is the number of flights. ℓ is the log-likelihood, θ (n,) the fit's scaled
    parameters. The controller must be known.
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


def nulls_from_scores(z: np.ndarray, signed: int | None = None) -> Nulls:
    """Return the distribution of the P scores, from their values z (B, P) in B simulated flights.

    The first ``signed`` scores (default: all) are of effects at trial values. The others are the
    largest scores over all frequencies or instants of an effect.
    """
    B, P = z.shape
    mean = z.mean(axis=0)
    std = _shrunk_std(z)
    inflation = float(np.median(std) ** 2)
    drift = np.where(np.arange(P) < (P if signed is None else signed), DRIFT * mean, 0.0)
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
    """Return the threshold of Z² that the largest of ``tests`` tests exceeds without any effect.

    The probability of this false alarm is `FALSE_ALARMS`.

    >>> round(bonferroni(60), 1)
    16.4
    """
    return float(chi2_isf(FALSE_ALARMS / tests, 1))


def formula_nulls(fit: CorrectedFit, screen: Screen, why: str) -> Nulls:
    """Return the scores' distribution without any effect, by formula; ``why`` not by simulation."""
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
