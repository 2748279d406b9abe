"""Fit a Gumbel distribution to maxima by the method of moments, and compute its quantiles.

    P(x < X) = exp(−exp(−(X − μ)/β)),     β = √6 s/π,     μ = x̄ − γ β

x̄ and s are mean and standard deviation of the maxima, γ is Euler's constant. A share α of all
maxima exceeds μ + k β with k = −ln(−ln(1 − α)).
"""

from __future__ import annotations

import math

import numpy as np


def gumbel(largest: np.ndarray, *, least: float = 0.0) -> tuple[float, float]:
    """Return (location μ, scale β) of the Gumbel distribution of maxima (B,); β ≥ ``least``."""
    beta = max(float(np.sqrt(6) * largest.std(ddof=1) / np.pi), least)
    return float(largest.mean()) - np.euler_gamma * beta, beta


def beyond(share: float) -> float:
    """Return k: the ``share`` of Gumbel-distributed maxima exceeds μ + k β (location, scale).

    >>> round(beyond(0.0005), 2)
    7.6
    """
    return -math.log(-math.log(1 - share))
