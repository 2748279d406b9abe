"""Reduces the sample rate of flights without bias.

The voltage is the exact mean of the held voltage over each new interval, the angle that at its
start. A voltage sampled there too would bias the rotor's lag by many standard deviations.
"""

from __future__ import annotations

import numpy as np


def held_means(
    voltage: np.ndarray, angle: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray]:
    """Returns u (M, 2) V, the mean of each ``factor`` samples, and y (M, 3) rad, their first."""
    M = len(voltage) // factor
    u = voltage[: M * factor].reshape(M, factor, 2).mean(axis=1)
    return u, angle[: M * factor : factor].copy()


def node_means(
    voltage: np.ndarray, angle: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray]:
    """Returns u (M, 2) V and y (M, 3) rad for tools that interpolate linearly between samples.

    u is the mean *around* each instant k, over [k − factor/2, k + factor/2); factor is even.
    """
    half = factor // 2
    M = (len(voltage) - half) // factor
    padded = np.vstack([np.repeat(voltage[:1], half, axis=0), voltage])
    u = padded[: M * factor].reshape(M, factor, 2).mean(axis=1)
    return u, angle[: M * factor : factor].copy()
