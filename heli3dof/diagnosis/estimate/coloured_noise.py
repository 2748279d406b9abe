"""Noise that is not white: what it makes a parameter scatter, beside what simulated flights show.

The filter's random torque is white, and so is that of the flights that calibrate it. A draught, a
cable that swings, a supply that hunts push for half a second at a time: what is slow then scatters
more than white noise of the intensity that the filter finds in what is fast. The recording itself
tells: with s_b the sums of the scores ∂ℓ/∂θ over `BLOCK_S` at the fit, b = 1 … m, about their mean,

    S = Γ_0 + Σ_{l=1}^{L} (1 − l/(L + 1)) (Γ_l + Γ_lᵀ),      Γ_l = Σ_b s_b s_{b+l}ᵀ

(Newey and West 1987) is their covariance with what is correlated over `MEMORY_S` in it, and with C
the covariance that the flights show

    ρ_j = (A⁻¹ S A⁻¹)_jj / (A⁻¹ C A⁻¹)_jj,         A = H + Λ

is how many times the variance of parameter j that one. Bartlett's weights over m blocks are worth
ν = 3 m/(2 (L + 1)) degrees of freedom; what white noise would exceed in a share `CHANCE` of
flights, ρ > χ²_ν/ν, is taken as it is, less is taken for one. A cause is believed where what stands
for it stands against that too: Z²/ρ beyond the nulls' threshold.

The causes are in the fit, so they colour nothing: what is coloured is what they do not explain.
"""

from __future__ import annotations

import numpy as np

from heli3dof.identification.greybox.estimate import Estimate, block_scores

BLOCK_S = 0.5
MEMORY_S = 3.0
CHANCE = 0.01


def colour(found: Estimate, flown: np.ndarray) -> np.ndarray:
    """(n,) ρ of the coordinates, at least one; ``flown`` (n, n) is C."""
    n = len(found.optimum.theta)
    scores = block_scores(found.problem.data, found.optimum, BLOCK_S)
    memory = round(MEMORY_S / BLOCK_S)
    if len(scores) < 2 * (memory + 1):
        return np.ones(n)
    inverse = np.linalg.inv(found.optimum.information + np.diag(found.problem.prior_precision))
    seen = np.diag(inverse @ long_run(scores, memory) @ inverse)
    white = np.diag(inverse @ flown @ inverse)
    return surely(seen / np.maximum(white, 1e-300), freedom(len(scores), memory))


def long_run(scores: np.ndarray, memory: int) -> np.ndarray:
    """(n, n) the covariance of the sum of (m, n) scores, correlated over ``memory`` rows."""
    s = scores - scores.mean(axis=0)
    S = s.T @ s
    for lag in range(1, memory + 1):
        G = s[:-lag].T @ s[lag:]
        S = S + (1 - lag / (memory + 1)) * (G + G.T)
    return np.asarray(S)


def freedom(blocks: int, memory: int) -> float:
    """ν of `long_run` over that many rows."""
    return 1.5 * blocks / (memory + 1)


def surely(ratio: np.ndarray, nu: float) -> np.ndarray:
    """``ratio`` where it is beyond what chance makes of one, else one."""
    from scipy.stats import chi2

    return np.where(ratio > float(chi2.isf(CHANCE, nu)) / nu, ratio, 1.0)
