"""The law of the largest of many: P(x < X) = exp(−exp(−(X − μ)/β)), told from few flights' moments.

    β = √6 s/π,   μ = x̄ − γ β       s their standard deviation, γ Euler's constant

A share α of flights lies beyond μ + k β,  k = −ln(−ln(1 − α)).
"""

from __future__ import annotations

import math

import numpy as np

EULER = 0.5772156649


def gumbel(largest: np.ndarray, *, least: float = 0.0) -> tuple[float, float]:
    """μ and β of (B,) largest values; β is ``least`` where it would be less."""
    beta = max(float(np.sqrt(6) * largest.std(ddof=1) / np.pi), least)
    return float(largest.mean()) - EULER * beta, beta


def beyond(share: float) -> float:
    """k, the β beyond μ that this share exceeds.

    >>> round(beyond(0.0005), 2)
    7.6
    """
    return -math.log(-math.log(1 - share))
