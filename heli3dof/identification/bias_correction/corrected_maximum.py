"""Maximise the bias-corrected log-likelihood ℓ_c.

θ are the base model's parameters, φ those of a candidate (an effect added to the base model), and a
the noise intensities. At the true values, the derivatives of the filter's log-likelihood ℓ should
have zero mean. But in flights simulated at θ_0, φ_0 (no effect) and a_0, they have the means ḡ
(∂ℓ/∂θ), b (∂ℓ/∂φ) and s̄ (∂ℓ/∂ln a); see `bias_correction.correction`. ℓ_c subtracts these means,
so that its derivatives have zero mean, to first order:

    ℓ_c(θ, φ, a) = ℓ(θ, φ, a) − ḡ·(θ − θ_0) − b·(φ − φ_0) − s̄·(ln a − ln a_0) + ln prior

The maximum of ℓ_c solves the estimating equation of `bias_correction.correction`. Twice the
difference of two models' ℓ_c is their likelihood-ratio statistic. The search is that of
`heli3dof.identification.greybox.maximum_likelihood` (Levenberg–Marquardt).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.identification.bias_correction.evaluation import (
    Evaluation,
    evaluate,
    fixed_parameters,
)
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum, damped_step, scaled_noise

ROUNDS = 14
TOLERANCE = 0.02  # predicted gain of the log-likelihood at which the search ends, chosen
NOISE_CONVERGED = 0.06  # largest step of ln a of a converged noise, chosen
CHECKED_GAIN = 2.0
"""A step with a smaller predicted gain of the log-likelihood is accepted unchecked. Chosen."""


@dataclass(frozen=True, eq=False)
class ScoreBias:
    """Mean derivatives of the log-likelihood over simulated flights.

    They are evaluated at the parameters ``theta_0`` and the noise ``noise_0`` with which the
    flights were simulated. For an exact likelihood, their expectation would be zero.
    """

    by_theta: np.ndarray
    """(n,) mean derivatives with respect to the n parameters: ḡ for θ, then b for φ"""
    by_log_noise: np.ndarray
    """(3,) mean derivatives s̄ with respect to ln a"""
    theta_0: np.ndarray
    """(n,) parameters of the simulated flights: θ_0, then φ_0"""
    noise_0: np.ndarray
    """(4,) noise of the simulated flights: a_0 (rad/s²/√Hz) of three axes, and jitter (s)"""

    def of_loglik(self, theta: np.ndarray, noise: np.ndarray) -> float:
        """Return the bias of the log-likelihood at ``theta`` (n,) and ``noise`` (4,).

        The bias is zero at the parameters and noise with which flights were simulated. It is linear
        in ``theta`` and in the logarithm of the process noise. Its gradient is the mean gradient of
        the log-likelihood of the simulated flights, which would be zero without a bias. The
        corrected log-likelihood is the log-likelihood minus this bias.
        """
        ratio = np.log(noise[:3] / self.noise_0[:3])
        return float(self.by_theta @ (theta - self.theta_0) + self.by_log_noise @ ratio)


def maximise_corrected(
    problem: Likelihood, start: np.ndarray, noise: np.ndarray, bias: ScoreBias | None, *,
    rounds: int = ROUNDS, hold_noise: bool = False, hold: np.ndarray | None = None,
) -> Optimum:  # fmt: skip
    """Return the parameters and noise that maximise the bias-corrected log-likelihood plus prior.

    The search starts at the scaled parameters ``start`` (n,) and the ``noise`` (4,): process noise
    of three axes, jitter. The jitter is not changed. ``hold`` (n,) bool marks parameters that keep
    their start values. With ``hold_noise``, the noise keeps its start values. ``rounds``: largest
    number of steps. Without ``bias``, the log-likelihood is not corrected.
    """
    if bias is None:
        bias = ScoreBias(np.zeros(len(start)), np.zeros(3), start, noise)
    low, high = problem.bounds
    theta, a = np.clip(start, low, high), noise.copy()
    precision = problem.prior_precision
    axes = problem.free_noise
    fixed = fixed_parameters(problem) if hold is None else fixed_parameters(problem) | hold
    lam, noise_step, converged = 1e-3, 0.0 if hold_noise else np.inf, False

    def corrected(loglik: np.ndarray, theta: np.ndarray, a: np.ndarray) -> float:
        return float(loglik.sum()) + problem.log_prior(theta) - bias.of_loglik(theta, a)

    current: Evaluation = evaluate(problem, theta, a, with_noise_derivatives=not hold_noise)
    for count in range(1, rounds + 1):
        if count > 1:
            with_noise = not hold_noise and (noise_step > NOISE_CONVERGED or count % 4 == 0)
            current = evaluate(problem, theta, a, with_noise_derivatives=with_noise)
        value = corrected(current.at.loglik, theta, a)
        g = current.g - bias.by_theta - precision * (theta - problem.prior_mean)
        A = current.H + np.diag(precision)
        free = problem.movable(theta, g) & ~fixed
        gain, accepted = 0.0, False
        for _ in range(10):
            delta, gain = damped_step(A, g, free, lam)
            if gain < TOLERANCE:
                accepted = True
                break
            new = np.clip(theta + delta, low, high)
            new_value = -np.inf
            if gain > CHECKED_GAIN:
                new_value = corrected(problem.loglik(new, a), new, a)
            if gain <= CHECKED_GAIN or new_value > value:
                theta, accepted = new, True
                lam = max(lam / 10, 1e-9)
                break
            lam *= 10
        if current.slope.any():
            curvature = np.minimum(current.curvature, -1.0)
            step = np.clip(-(current.slope - bias.by_log_noise) / curvature, -0.7, 0.7)
            step = np.where(axes, step, 0.0)
            noise_step = float(np.abs(step).max())
            if noise_step > NOISE_CONVERGED:
                a = scaled_noise(a, step)
        converged = bool(accepted and gain < TOLERANCE and noise_step <= NOISE_CONVERGED)
        if converged or not accepted:
            break
    if not converged:  # the last step changed theta or the noise
        current = evaluate(problem, theta, a, with_noise_derivatives=False)
    return Optimum(
        theta, a, corrected(current.at.loglik, theta, a), current.H, current.at, current.T,
        (theta <= low) | (theta >= high), count, converged,
    )  # fmt: skip
