"""Test whether a torque that starts at one instant is more than coloured noise.

Coloured noise, such as a draught's torque, is correlated over time, so it can look like a step. Let
τ_k (N·m), k = 1 … K, be the mean residual torque of one axis in intervals of w seconds, and t_k
their centres. The model with a step is

    τ_k = μ + Δ s_k(t_0) + n_k,        s_k(t_0) = 1 if t_k > t_0, otherwise 0
    Cov(n_j, n_k) = σ² (c(t_j − t_k) + r c(0) δ_jk)

The noise n is coloured noise plus white noise. The coloured noise is an Ornstein-Uhlenbeck process
with the correlation time T and the variance σ². σ² c(t) is the autocovariance of its means over w
seconds. r is the variance of the white noise, divided by the variance σ² c(0) of these means:

    c(0) = 2 (a − 1 + exp(−a))/a²,                             a = w/T
    c(t) = ((1 − exp(−a))/a)² · exp(−(|t| − w)/T)  for |t| ≥ w

Different recordings are independent. With ln L, the logarithm of the likelihood, the test statistic
is the likelihood ratio

    LR = 2 (max ln L over μ, σ, T, r, Δ, t_0  −  max ln L over μ, σ, T, r)

Its distribution without a step is simulated: LR of `DRAWS` noise sequences with the estimates μ,
σ, T, r of the model without a step. A Gumbel distribution fitted to them gives the threshold that
noise exceeds with the probability `FALSE_ALARMS` (`search.nulls`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from heli3dof.diagnosis.constants import FALSE_ALARMS
from heli3dof.diagnosis.search.nulls import gumbel, gumbel_factor
from heli3dof.diagnosis.unmodelled.residual_torque import linearised_run
from heli3dof.identification.greybox.estimate import Estimate

INTERVAL_S = 0.5
"""s, w of the module docstring. The residual torque is accurate below a few Hz. Chosen."""
MOST_INTERVALS = 150
"""Largest K: longer flights have longer intervals. Chosen."""
CORRELATION_TIMES_S = 0.1 * 2.0 ** np.arange(10)
"""s, trial values of T, from white noise to a drift"""
WHITE_SHARES = np.array([0.0, 0.03, 0.1, 0.3, 1.0, 3.0])
"""Trial values of r. Chosen."""
DRAWS = 200
"""Simulated noise sequences"""
MIN_INTERVALS = 3
"""Least number of intervals before a step and after it"""


class Series(NamedTuple):
    """Mean values of a signal in K intervals of time."""

    source: np.ndarray
    """(K,) index of the recording"""
    t: np.ndarray
    """(K,) s since the recording's first sample: centre of the interval"""
    mean: np.ndarray
    """(K,) mean value of the signal in the interval"""
    width_s: float


def step_margin(fit: Estimate, axis: int, *, seed: int) -> float:
    """Return LR divided by its threshold, for a step in the residual torque of one axis.

    Below 1, coloured noise explains the step. ``fit``: a model without the step. ``axis``: 0 roll,
    1 pitch, 2 yaw. The result is 0 if the recordings are too short for this test.
    """
    run = linearised_run(fit)
    d, tau = run.data, run.torque[:, axis]
    source = np.zeros(len(d.t), dtype=np.int64)
    for r, (_, start, stop) in zip(d.runs, d.blocks, strict=True):
        source[start:stop] = r.source
    rows = np.isfinite(tau)
    series = interval_means(source[rows], d.t[rows], tau[rows])
    if len(np.unique(series.t)) < 2 * MIN_INTERVALS:
        return 0.0
    ratio, threshold = step_test(series, np.random.default_rng(seed))
    return ratio / threshold


def interval_means(source: np.ndarray, t: np.ndarray, x: np.ndarray) -> Series:
    """Return the mean of a signal x (N,) in each of many intervals of equal length.

    The length is `INTERVAL_S`, or more if this would give more than `MOST_INTERVALS` intervals.
    ``source`` (N,): index of each sample's recording. ``t`` (N,): time of each sample in s. An
    interval is omitted if it has fewer than half the median number of samples.
    """
    seconds = sum(np.ptp(t[source == s]) for s in np.unique(source))
    width = max(INTERVAL_S, float(seconds) / MOST_INTERVALS)
    number = np.floor(t / width).astype(np.int64)
    number -= number.min(initial=0)
    key = source * (number.max(initial=0) + 1) + number
    _, first, of_row, count = np.unique(
        key, return_index=True, return_inverse=True, return_counts=True
    )
    full = count >= 0.5 * np.median(count)
    mean = np.bincount(of_row, x) / count
    centre = (np.floor(t[first] / width) + 0.5) * width
    return Series(source[first][full], centre[full], mean[full], width)


def step_test(series: Series, rng: np.random.Generator) -> tuple[float, float]:
    """Return (LR, its threshold) of the module docstring for a step in ``series``."""
    test = _StepTest(series)
    ratio, best = test.likelihood_ratio(series.mean[:, None])
    root = test.roots[best[0]]
    draws = root @ rng.standard_normal((len(root), DRAWS))
    mu, beta = gumbel(test.likelihood_ratio(draws)[0])
    return float(ratio[0]), mu + beta * gumbel_factor(FALSE_ALARMS)


class _StepTest:
    """Likelihood ratio test of a step in a time series of K values with noise.

    The noise is the sum of coloured and white noise. T is the correlation time of the coloured
    noise. r is the variance of the white noise, divided by that of the coloured noise. Each pair of
    trial values of T and r is a noise model. The likelihood is evaluated for all P noise models.
    """

    def __init__(self, series: Series) -> None:
        t, w, K = series.t, series.width_s, len(series.t)
        distance = np.abs(t[:, None] - t)
        apart = series.source[:, None] != series.source
        a = (w / CORRELATION_TIMES_S)[:, None, None]
        own = 2 * (a - 1 + np.exp(-a)) / a**2
        between = np.maximum(distance - w, 0.0)
        others = (np.expm1(-a) / a) ** 2 * np.exp(-between / CORRELATION_TIMES_S[:, None, None])
        c = np.where(distance < 0.5 * w, own, others)
        c[:, apart] = 0.0
        C = c[:, None] + WHITE_SHARES[:, None, None] * own[:, None] * np.eye(K)
        self.roots = np.linalg.cholesky(C.reshape(-1, K, K))
        """(P, K, K) Cholesky factors of the noise's covariance, for σ = 1"""
        self.whiten = np.linalg.inv(self.roots)
        self.log_det = 2 * np.log(np.diagonal(self.roots, axis1=1, axis2=2)).sum(axis=1)
        constant = self.whiten.sum(axis=2)
        self.constant = constant / np.linalg.norm(constant, axis=1, keepdims=True)
        starts = np.unique(t)[MIN_INTERVALS : 1 - MIN_INTERVALS] - 0.5 * w
        steps = self._without_mean(self.whiten @ (t[:, None] > starts).astype(float))
        self.steps = steps / np.linalg.norm(steps, axis=1, keepdims=True)

    def _without_mean(self, x: np.ndarray) -> np.ndarray:
        """Return whitened series (P, K, n) without the contribution of their mean μ.

        ``x`` (P, K, n) contains n series of K values, each whitened with the noise covariances of P
        noise models. Before whitening, a series is a constant μ plus noise. The function estimates
        μ by least squares and subtracts the whitened constant.
        """
        e = self.constant[:, :, None]
        return np.asarray(x - e * (e * x).sum(axis=1, keepdims=True))

    def likelihood_ratio(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the likelihood ratios LR (n,) of n series, and indices (n,) of noise models.

        ``x`` (K, n) contains n series of K values. LR is 2 ln L with the best step, minus 2 ln L
        without a step. The likelihood L is maximised over the P noise models of the class. The
        second result is, for each series, the index of the noise model with the largest likelihood
        without a step.
        """
        z = self._without_mean(self.whiten @ x)
        square = (z**2).sum(axis=1)
        explained = ((self.steps.transpose(0, 2, 1) @ z) ** 2).max(axis=1)
        K, log_det = len(x), self.log_det[:, None]
        without, with_step = (-K * np.log(q) - log_det for q in (square, square - explained))
        return with_step.max(axis=0) - without.max(axis=0), without.argmax(axis=0)
