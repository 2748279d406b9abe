"""Estimate sampling jitter from the motion, when the log's time stamps do not show it.

If a host was late and caught up, but logged evenly spaced times t_k, it took sample k at t_k + δ_k.
All angles y_i are displaced by the same δ_k::

    y_i(t_k + δ_k) ≈ y_i(t_k) + ẏ_i δ_k

A parabola is fitted to each angle over ± `HALF_WINDOW_S`. e_i is the fit's residual at the middle
sample, divided by √(1 − h), where h is this sample's leverage. The axes have δ in common, but not
the errors from encoder steps and from motion that is no parabola. So σ_t², the variance of δ, is
estimated from the products e_i e_j, summed over samples and pairs of axes i < j:

    σ_t² = Σ u e_i e_j w / Σ u w²,      w = ẏ_i ẏ_j,    u = 1 / (s_i² s_j²),  s² = q²/12 + (τ ẏ)²

s_i² is the assumed variance of e_i. It is the sum of two variances: q²/12 from rounding to the
encoder's step q, and (τ ẏ_i)² from a jitter of standard deviation τ = `SCALE_S`. The weight u is
the inverse of s_i² s_j², the assumed variance of e_i e_j. For a single axis, σ_t² is the slope of
the linear regression of e² on ẏ².

The standard deviation of σ_t² is estimated by a jackknife over blocks of `BLOCK_S`. Without jitter,
σ_t² divided by this standard deviation follows Student's t with ν = 1/Σ b² − 1 degrees of freedom.
Here b is the fraction of the denominator Σ u w² that one block contributes. If delays last longer
than the window, the true jitter is larger than the estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.distributions import t_isf

HALF_WINDOW_S = 0.03
SCALE_S = 1e-3
"""s, τ: jitter that is assumed for the weights u"""
LEAST = 2
"""Smallest number of samples on each side of a window's middle; a parabola needs three in all"""
BLOCK_S = 0.25
CHANCE = 5e-4
"""Probability of a false report of jitter for an even clock"""
LEAST_REPORTED_S = 2e-4
"""s: a smaller jitter is not reported"""
EVEN = 1e-6
"""Range of the intervals, as a share of the period, below which the clock counts as even: such a
range is rounding"""


@dataclass(frozen=True)
class MotionJitter:
    """Estimated sampling jitter σ_t (RMS, s), and the standard deviation of σ_t² (s²)."""

    sigma_s: float
    variance_std_s2: float
    freedom: float = np.inf
    """ν, the degrees of freedom of ``variance_std_s2``"""

    @property
    def is_significant(self) -> bool:
        """Return True if the jitter σ_t is statistically significant and above 0.2 ms."""
        if not self.sigma_s > LEAST_REPORTED_S:
            return False
        return bool(self.sigma_s**2 > t_isf(CHANCE, self.freedom) * self.variance_std_s2)


NONE_FOUND = MotionJitter(0.0, np.inf)


def motion_jitter(t: np.ndarray, angle: np.ndarray, rad_per_count: np.ndarray) -> MotionJitter:
    """Return the sampling jitter σ_t, estimated from angles (N, 3) rad at times ``t`` (N,) s.

    An angle that was not measured is NaN. ``rad_per_count`` (3,) is the step of each encoder.
    Windows in which an axis moves by less than two steps are not used for this axis. For logs that
    are too short the result is σ_t = 0.
    """
    dt = float((t[-1] - t[0]) / max(len(t) - 1, 1))
    half = max(LEAST, round(HALF_WINDOW_S / dt))
    axes = [i for i in range(3) if np.isfinite(angle[:, i]).all()]
    if not axes or len(t) < 20 * half:
        return NONE_FOUND
    residuals, rates = [], []
    for i in axes:
        e, rate = _residual(t, angle[:, i], half)
        moves = np.abs(rate) * 2 * half * dt > 2 * abs(rad_per_count[i])
        residuals.append(np.where(moves, e, np.nan))
        rates.append(rate)
    blocks = ((t[half:-half] - t[0]) / BLOCK_S).astype(int)
    if len(axes) == 1:
        return _single_axis(residuals[0], rates[0], blocks)
    top = np.zeros(blocks[-1] + 1)
    below = np.zeros_like(top)
    for j in range(len(axes)):
        for i in range(j):
            w = rates[i] * rates[j]
            product = residuals[i] * residuals[j]
            u = 1 / (_scatter(rates[i], rad_per_count[i]) * _scatter(rates[j], rad_per_count[j]))
            there = np.isfinite(product)
            top += np.bincount(blocks[there], (u * product * w)[there], len(top))
            below += np.bincount(blocks[there], (u * w * w)[there], len(top))
    return _jackknife(top, below)


def _residual(t: np.ndarray, y: np.ndarray, half: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the residuals e (rad) and slopes (rad/s) of parabolas fitted to one angle.

    Each parabola is fitted to 2 ``half`` + 1 samples; its residual and slope are those at the
    middle sample. Both results have the shape (N − 2 ``half``,). The module's docstring defines e.
    """
    width = 2 * half + 1
    windows = np.lib.stride_tricks.sliding_window_view
    T = windows(t, width) - t[half:-half, None]
    even = float(np.ptp(np.diff(t))) < EVEN * float(t[1] - t[0])
    if even:  # all windows are alike
        T = T[:1]
    scale = float(np.abs(T).max())
    X = np.stack([np.ones_like(T), T / scale, (T / scale) ** 2], axis=2)
    G = np.swapaxes(X, 1, 2) @ X
    if even:
        weights = np.linalg.solve(G[0], X[0].T)
        fit = np.column_stack([np.correlate(y, w, "valid") for w in weights])
    else:
        fit = np.linalg.solve(G, np.einsum("nkj,nk->nj", X, windows(y, width))[..., None])[..., 0]
    own = np.linalg.inv(G)[:, 0, 0]
    return (y[half:-half] - fit[:, 0]) / np.sqrt(1 - own), fit[:, 1] / scale


def _scatter(rate: np.ndarray, step: float) -> np.ndarray:
    """Return the variance s² = q²/12 + (`SCALE_S` ẏ)² (N,), in rad², of an angle's residual.

    ``rate``: the angle's rate ẏ (rad/s); ``step``: the encoder's step q (rad).
    """
    return np.asarray(step**2 / 12 + (SCALE_S * rate) ** 2)


def _single_axis(e: np.ndarray, rate: np.ndarray, blocks: np.ndarray) -> MotionJitter:
    """Return the jitter σ_t (s) of one axis from the least-squares fit e² = const + σ_t² ẏ².

    ``e``: residuals of the fitted parabolas (rad); ``rate``: the angle's rate ẏ (rad/s);
    ``blocks``: each sample's block of the jackknife.
    """
    there = np.isfinite(e)
    if there.sum() < 100:
        return NONE_FOUND
    y, x = e[there] ** 2, rate[there] ** 2
    w = x - x.mean()
    count = blocks[-1] + 1
    top = np.bincount(blocks[there], (y - y.mean()) * w, count)
    below = np.bincount(blocks[there], w * w, count)
    return _jackknife(top, below)


def _jackknife(top: np.ndarray, below: np.ndarray) -> MotionJitter:
    """Return the jitter σ_t (s), and the standard deviation of σ_t² by the jackknife.

    σ_t² = Σ top / Σ below; ``top``, ``below``: numerator and denominator in each block.
    """
    kept = below > 0
    top, below = top[kept], below[kept]
    n = len(top)
    if n < 5:
        return NONE_FOUND
    whole = top.sum() / below.sum()
    without = (top.sum() - top) / (below.sum() - below)
    std = float(np.sqrt((n - 1) / n * np.sum((without - without.mean()) ** 2)))
    freedom = float(below.sum() ** 2 / (below @ below) - 1)
    return MotionJitter(float(np.sqrt(max(whole, 0.0))), std, freedom)
