"""Compute how much coloured noise increases the variance of each parameter.

The filter and the simulated flights have white noise. Draughts or a swinging cable cause noise that
is correlated over time, and parameters then scatter more. ℓ is the log-likelihood, θ (n,) are the
parameters. Let s_b (n,), b = 1 … m, be the sums of the score ∂ℓ/∂θ over blocks of `BLOCK_S`, minus
their mean. The covariance of Σ s_b, by Newey and West (1987) with L = `MEMORY_S` / `BLOCK_S`, is

    S = Γ_0 + Σ_{l=1}^{L} (1 − l/(L + 1)) (Γ_l + Γ_lᵀ),      Γ_l = Σ_b s_b s_{b+l}ᵀ

Let C be the covariance of the simulated flights' scores, H the information of the recordings and Λ
that of the prior. Coloured noise multiplies the variance of parameter j by

    ρ_j = (A⁻¹ S A⁻¹)_jj / (A⁻¹ C A⁻¹)_jj,         A = H + Λ

S has about ν = 3 m/(2 (L + 1)) degrees of freedom. White noise may explain a ρ up to the
1 − `CHANCE` quantile of χ²_ν/ν, so such a ρ is set to 1. The diagnosis divides the squared score Z²
of a cause by this ρ (`heli3dof.diagnosis.conclusion.adoption`).
"""

from __future__ import annotations

import numpy as np

from heli3dof.distributions import chi2_isf
from heli3dof.identification.greybox.estimate import BLOCK_S, Estimate, block_scores

MEMORY_S = 3.0  # s, longest correlation that S includes, chosen
CHANCE = 0.01  # probability that white noise alone gives ρ > 1, chosen


def colour(fit: Estimate, scatter: np.ndarray) -> np.ndarray:
    """Return ρ (n,), the factors by which coloured noise increases the parameters' variances.

    ``scatter`` (n, n) is C, the covariance of the simulated flights' scores. If the recordings have
    fewer than 2 (L + 1) blocks of `BLOCK_S`, with L = `MEMORY_S` / `BLOCK_S`, all factors are 1.
    """
    n = len(fit.optimum.theta)
    scores = block_scores(fit.problem.data, fit.optimum)
    memory = round(MEMORY_S / BLOCK_S)
    if len(scores) < 2 * (memory + 1):
        return np.ones(n)
    inverse = np.linalg.inv(fit.optimum.information + np.diag(fit.problem.prior_precision))
    coloured = np.diag(inverse @ long_run(scores, memory) @ inverse)
    white = np.diag(inverse @ scatter @ inverse)
    return significant_ratio(coloured / np.maximum(white, 1e-300), freedom(len(scores), memory))


def long_run(scores: np.ndarray, memory: int) -> np.ndarray:
    """Return the covariance S (n, n) of the sum of m correlated ``scores`` (m, n).

    Row b of ``scores`` is the score of block b. Method: Newey and West, with autocovariances up to
    the lag L = ``memory`` (in blocks).
    """
    s = scores - scores.mean(axis=0)
    S = s.T @ s
    for lag in range(1, memory + 1):
        G = s[:-lag].T @ s[lag:]
        S = S + (1 - lag / (memory + 1)) * (G + G.T)
    return np.asarray(S)


def freedom(blocks: int, memory: int) -> float:
    """Return ν = 3 m/(2 (L + 1)), the degrees of freedom of a Newey–West covariance (`long_run`).

    The covariance is estimated from m = ``blocks`` scores (gradients of the log-likelihood), one
    for each block of data. It includes autocovariances up to the lag L = ``memory`` (in blocks).
    """
    return 1.5 * blocks / (memory + 1)


def significant_ratio(ratio: np.ndarray, nu: float, chance: float = CHANCE) -> np.ndarray:
    """Return ``ratio`` where it exceeds the 1 − ``chance`` quantile of χ²_ν/ν; elsewhere 1."""
    return np.where(ratio > float(chi2_isf(chance, nu)) / nu, ratio, 1.0)
