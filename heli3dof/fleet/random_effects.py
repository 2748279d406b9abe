"""Estimate a quantity from several measurements with errors and with scatter between them.

Random-effects model of n measurements yᵢ with standard deviations sᵢ, all in the quantity's unit::

    yᵢ = θ + bᵢ + eᵢ,   bᵢ ~ N(0, τ²),   eᵢ ~ N(0, sᵢ²),   wᵢ = 1/(sᵢ² + τ²)
    θ̂ = Σwᵢyᵢ / Σwᵢ,    Q(τ²) = Σwᵢ(yᵢ − θ̂)²

θ is the quantity, bᵢ the scatter between measurements, eᵢ the error of one measurement. Q has the
expected value n − 1 at the true τ², and falls as τ² grows. So τ² is the root of Q(τ²) = n − 1, or
0 if Q(0) < n − 1 (Paule and Mandel, J. Res. NBS 87, 1982).

The interval of θ is θ̂ ± t(n−1) · √(Q/(n−1)/Σwᵢ) (Hartung and Knapp, Stat. Med. 20, 2001). If all sᵢ
are equal, or unknown (sᵢ = 0), it is the t interval of the mean.

The true value θ + bᵢ of measurement i has the shrinkage estimate θ̂ + B(yᵢ − θ̂), where
B = τ²/(τ² + sᵢ²). The variance of this estimate is B·sᵢ² + (1 − B)²·var θ̂.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np

from heli3dof.arrays import FloatArray

LEVEL = 0.95
"""Coverage of all intervals (a convention)"""


@dataclass(frozen=True)
class Estimate:
    """Estimate of a quantity from n measurements, in the quantity's unit."""

    n: int
    value: float
    std: float
    """Standard error of ``value``; NaN if it is not known"""
    scatter: float
    """Standard deviation τ of the true values of the measurements; NaN if n is 1"""

    @property
    def interval(self) -> tuple[float, float]:
        """Return the two limits of the confidence interval of ``value``, with coverage `LEVEL`.

        Both limits are NaN if the estimate comes from a single measurement (``n`` = 1).
        """
        from scipy.stats import t

        if self.n < 2:
            return np.nan, np.nan
        half = float(t.ppf(0.5 + LEVEL / 2, self.n - 1)) * self.std
        return self.value - half, self.value + half


def random_effects(y: FloatArray, s: FloatArray, hidden: FloatArray | None = None) -> Estimate:
    """Return the estimate of a quantity from values ``y`` (n,) with standard deviations ``s`` (n,).

    s = 0 means that the error of a measurement is unknown. This error then counts as scatter.
    ``hidden`` (n,): variances hᵢ, as in `change_posterior`. They add Σwᵢhᵢ to Q in the interval.
    """
    n = len(y)
    if n == 1:
        std = float(s[0]) if s[0] > 0 else np.nan
        return Estimate(1, float(y[0]), std, np.nan)
    variance = scatter_variance(y, s)
    w = _weights(s, variance)
    value = float(y[0] + w @ (y - y[0]) / w.sum())  # exact if all y are equal
    q = float(w @ ((y - value) ** 2 + (0.0 if hidden is None else hidden))) / (n - 1)
    return Estimate(n, value, sqrt(q / w.sum()), sqrt(variance))


def scatter_variance(y: FloatArray, s: FloatArray) -> float:
    """Return the variance τ² of the true values of n ≥ 2 measurements.

    ``y``, ``s`` (n,): the measurements and the standard deviations of their errors.
    """
    from scipy.optimize import brentq

    n = len(y)
    # Q(τ²) ≤ Σ(yᵢ − ȳ)²/τ², so the root of Q = n − 1 is at most the variance of y.
    most = float(np.var(y, ddof=1))
    if most <= np.finfo(float).tiny:
        return 0.0

    def excess(variance: float) -> float:
        w = _weights(s, variance)
        return float(w @ (y - w @ y / w.sum()) ** 2) - (n - 1)

    if not np.any(s > 0):
        return most
    least = 0.0 if np.all(s > 0) else 1e-12 * most
    if excess(least) <= 0:
        return 0.0
    if excess(most) >= 0:  # by rounding, if all s are tiny compared with the scatter
        return most
    return float(brentq(excess, least, most, xtol=1e-12 * most, rtol=1e-12))


def _weights(s: FloatArray, variance: float) -> FloatArray:
    total = s**2 + variance
    if not np.all(total > 0):  # equal measurements without standard deviations
        return np.ones_like(s)
    return 1.0 / total


def shrunken(y: FloatArray, s: FloatArray, estimate: Estimate) -> tuple[FloatArray, FloatArray]:
    """Return shrinkage estimates (n,) of the true values of n ≥ 2 measurements, and their std (n,).

    The estimates lie between the measurements and their mean. ``y``, ``s`` (n,): the measurements
    and the standard deviations of their errors. ``estimate``: what `random_effects` returns for
    ``y`` and ``s``.
    """
    total = s**2 + estimate.scatter**2
    share = np.divide(estimate.scatter**2, total, out=np.zeros_like(s), where=total > 0)
    value = estimate.value + share * (y - estimate.value)
    return value, np.sqrt(share * s**2 + (1 - share) ** 2 * estimate.std**2)
