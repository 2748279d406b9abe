"""Flights at a slower rate for the black boxes, without bias.

Exact means of the held voltage over [k, k+1) and angles picked at k; picking the voltage as well
would bias the rotor's lag by many standard deviations.
"""

from __future__ import annotations

import numpy as np


def held_means(
    voltage: np.ndarray, angle: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray]:
    """u (M, 2) V, the mean over each ``factor`` samples; y (M, 3) rad, the first of each."""
    M = len(voltage) // factor
    u = voltage[: M * factor].reshape(M, factor, 2).mean(axis=1)
    return u, angle[: M * factor : factor].copy()


def node_means(
    voltage: np.ndarray, angle: np.ndarray, factor: int
) -> tuple[np.ndarray, np.ndarray]:
    """For tools that interpolate linearly between samples: u is the mean *around* each instant.

    (M, 2) V over [k − factor/2, k + factor/2) and (M, 3) rad; factor is even.
    """
    half = factor // 2
    M = (len(voltage) - half) // factor
    padded = np.vstack([np.repeat(voltage[:1], half, axis=0), voltage])
    u = padded[: M * factor].reshape(M, factor, 2).mean(axis=1)
    return u, angle[: M * factor : factor].copy()
