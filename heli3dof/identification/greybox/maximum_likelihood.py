"""Maximise the likelihood by Gauss–Newton steps on the innovations; also estimate the noise.

Each round has two parts, one for the noise and one for the scaled parameters θ.

1. A Newton step of ln a for the process noise a of each axis. Slope and curvature come from the
   axis' part of the log-likelihood at a lower, the present and a higher noise. This part hardly
   depends on the noise of the other axes. So three filter runs, each with the same change of ln a
   on all axes, are enough. Once the noise has converged, only every fourth round takes this step.
2. A step δ of θ, within the bounds. Let c be the filter's prediction of a reading, and ∂c its
   gradient with respect to θ at fixed filter gains. g is the score of the reading, w its
   information. Λ is the prior's precision, θ_0 its mean. δ solves

    (H + Λ + λ diag(H + Λ)) δ = Σ g ∂c − Λ (θ − θ_0),     H = Σ w ∂c ∂cᵀ

The Levenberg–Marquardt factor λ grows until the step raises the likelihood. A step with a small
predicted increase is not checked (`CHECKED_GAIN`). The search ends when half the Newton decrement
(the predicted increase of the log-likelihood) is below `TOLERANCE`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from heli3dof.identification.greybox.likelihood import (
    Likelihood,
    score_and_information,
)
from heli3dof.model.compiled import announced
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.parallel import parallel_map

TOLERANCE = 2e-3
"""The search ends when a step's predicted increase of the log-likelihood is below this value, which
corresponds to a step of 0.06 standard deviations."""
ROUNDS = 25
OTHER_ROUNDS = 12
"""Largest number of rounds from each other start point, if the first search does not converge"""
CHECKED_GAIN = 3.0
"""A step with a smaller predicted increase of the log-likelihood is accepted without evaluating the
likelihood, which is rough at this scale: it also depends on θ through the filter's covariance. The
score omits this part, whose expectation is zero."""
FULL_STEP_ROUNDS = 5
"""Number of rounds with full steps. Dry friction makes the score rough at a tenth of σ, so that
full steps may never converge. In the later rounds, after n reversals of the step's direction, only
the share 1/(n + 1) of a step is taken (Kesten, 1958). So the steps converge to the middle of the
rough region. Steps with a predicted increase above `CHECKED_GAIN` stay full."""
NOISE_SETTLED = 0.05
"""The noise has converged when a step changes the logarithm of its intensity by less than this."""
NOISE_START = (0.03, 0.06, 0.02, 0.0)
"""Initial process noise on roll, pitch, yaw (rad/s²/√Hz) and sampling jitter (s). The noise is
several times that of a quiet rig, so that the search from a poor start does not diverge."""
NOISE_LOW, NOISE_HIGH = 1e-5, 30.0
JITTERS = (0.001, 0.002, 0.004, 0.008)
"""s: values of sampling jitter, tried in ascending order in the rounds `JITTER_ROUNDS`"""
JITTER_ROUNDS = (2, 5)
JITTER_WORTH = 10.0
"""Increase of the log-likelihood above which a larger jitter is accepted."""
PROBE = 0.5  # step of ln a in the differences for slope and curvature


@dataclass(frozen=True, eq=False)
class Optimum:
    """The parameters and noise that maximise likelihood times prior, with the filter's output.

    ``at`` is the output of the Kalman filter for these parameters and this noise.
    """

    theta: np.ndarray
    """(n,) scaled parameters at the maximum"""
    noise: np.ndarray
    """(4,) process noise on roll, pitch, yaw in rad/s²/√Hz, and sampling jitter in s"""
    loglik: float
    """Log-likelihood plus log prior at the maximum"""
    information: np.ndarray
    """(n, n) information of the scaled parameters, without the prior's"""
    at: FilterRun
    tangents: np.ndarray
    """(n, E) derivatives of the E predicted readings with respect to the scaled parameters"""
    at_bound: np.ndarray
    """(n,) bool: the parameters that are at their lowest or highest value"""
    rounds: int
    converged: bool


def compile_first(problem: Likelihood) -> None:
    """Compile the likelihood's code once per process; log a message if this takes long."""
    from heli3dof.model.estimation.ekf_quantised import filter_blocks

    if filter_blocks.signatures:
        return
    with announced("Compiling the grey-box estimator; this happens once and takes a while …"):
        theta = problem.prior_mean
        problem.tangents(theta, problem.run(theta, np.array(NOISE_START)), np.arange(1))


def maximise(
    problem: Likelihood,
    start: np.ndarray,
    noise: np.ndarray | None = None,
    *,
    rounds: int = ROUNDS,
) -> Optimum:
    """Return the parameters and noise that maximise likelihood times prior.

    ``problem`` is the likelihood, a function of n scaled parameters and the noise. The search
    starts at the scaled parameters ``start`` (n,) and at ``noise`` (4,). The first three elements
    of ``noise`` are the process noise on roll, pitch and yaw (rad/s²/√Hz). The fourth is the
    sampling jitter (s). ``rounds`` is the largest number of iterations. Each iteration takes a step
    of the parameters and, if needed, a step of the noise.
    """
    low, high = problem.bounds
    theta = np.clip(start, low, high)
    a = np.array(NOISE_START if noise is None else noise, dtype=float)
    axes = problem.data.axes
    precision = problem.prior_precision
    lam = 1e-3
    settled = False
    moved = np.inf
    turns, last = 0, np.zeros(len(theta))
    for count in range(1, rounds + 1):
        if moved > NOISE_SETTLED or count % 4 == 0:
            a, moved = noise_step(problem, theta, a, axes)
        if count in JITTER_ROUNDS:
            a = _better_jitter(problem, theta, a)
        at = problem.run(theta, a)
        here = float(at.loglik.sum()) + problem.log_prior(theta)
        D = problem.tangents(theta, at)
        g, H = score_and_information(at, D)
        g = g - precision * (theta - problem.prior_mean)
        A = H + np.diag(precision)
        go = problem.movable(theta, g)
        gain, part = 0.0, 1.0
        accepted = False
        for tried in range(12):
            delta, gain = damped_step(A, g, go, lam)
            if not tried:
                is_reversed = bool(last @ A @ delta < 0)
                turns += count > FULL_STEP_ROUNDS and gain <= CHECKED_GAIN and is_reversed
                last = delta
            part = 1.0 / (1 + turns) if gain <= CHECKED_GAIN else 1.0
            if gain * part**2 < TOLERANCE:
                accepted = True
                break
            new = np.clip(theta + part * delta, low, high)
            there = -np.inf
            if gain > CHECKED_GAIN:
                there = float(problem.loglik(new, a).sum()) + problem.log_prior(new)
            if gain <= CHECKED_GAIN or there > here:
                theta, accepted = new, True
                lam = max(lam / 10, 1e-9)
                break
            lam *= 10
        settled = accepted and gain * part**2 < TOLERANCE and moved <= NOISE_SETTLED
        if settled or not accepted:
            break
    if not settled:  # the last step changed theta or the noise
        at = problem.run(theta, a)
        here = float(at.loglik.sum()) + problem.log_prior(theta)
        D = problem.tangents(theta, at)
    g, H = score_and_information(at, D)
    return Optimum(theta, a, here, H, at, D, (theta <= low) | (theta >= high), count, settled)


def damped_step(
    A: np.ndarray, g: np.ndarray, free: np.ndarray, lam: float
) -> tuple[np.ndarray, float]:
    """Return the damped Newton step δ (n,), and the predicted log-likelihood increase ½ gᵀδ.

    The Levenberg–Marquardt factor λ = ``lam`` damps the step: δ solves (A + λ diag A) δ = g. ``A``
    (n, n) is the information with the prior, ``g`` (n,) the gradient. Only the parameters ``free``
    (n,) bool change; for the others, δ is 0.
    """
    damped = A[np.ix_(free, free)] + lam * np.diag(np.diag(A)[free])
    delta = np.zeros(len(g))
    delta[free] = np.linalg.solve(damped, g[free])
    return delta, 0.5 * float(g[free] @ delta[free])


class HasLikelihood(Protocol):
    """An object with a method ``loglik``, which returns the log-likelihood (3,) by axis.

    ``theta`` (n,) are scaled parameters. The first three elements of ``a`` (4,) are the process
    noise of roll, pitch and yaw. The fourth is the sampling jitter.
    """

    def loglik(self, theta: np.ndarray, a: np.ndarray, /) -> np.ndarray: ...


def noise_step(
    problem: HasLikelihood, theta: np.ndarray, a: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, float]:
    """Return the noise (4,) after one Newton step of its logarithms, and the largest |step|.

    ``theta`` (n,) are the scaled parameters, ``a`` (4,) is the noise before the step. The first
    three elements of ``a`` are the process noise on roll, pitch and yaw (rad/s²/√Hz). The fourth,
    the sampling jitter (s), stays fixed. So does the noise of an unmeasured axis, for which
    ``axes`` (3,) is False. Slope and curvature of the log-likelihood are finite differences with
    the step `PROBE` in ln a. At smaller scales, the log-likelihood is rough.
    """
    factor = np.array([np.exp(PROBE)] * 3 + [1.0])
    at = (a, a * factor, a / factor)
    mid, up, down = parallel_map(lambda i: problem.loglik(theta, at[i]), 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (up - down) / (2 * PROBE)
        bend = -(up - 2 * mid + down) / PROBE**2
        move = np.where(bend > 0, slope / bend, np.sign(slope))
    move = np.where(axes & np.isfinite(move), np.clip(move, -0.7, 1.0), 0.0)
    return scaled_noise(a, move), float(np.abs(move).max())


def scaled_noise(noise: np.ndarray, step: np.ndarray) -> np.ndarray:
    """Return ``noise`` (4,) with its first three elements multiplied by exp(``step``) (3,).

    These elements are the process noise of roll, pitch and yaw (rad/s²/√Hz). They are limited to
    `NOISE_LOW` … `NOISE_HIGH`. The last element, the sampling jitter, does not change.
    """
    a = np.clip(noise[:3] * np.exp(step), NOISE_LOW, NOISE_HIGH)
    return np.append(a, noise[3])


def _better_jitter(problem: Likelihood, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the noise ``a`` (4,) with a new jitter (s): 0, or one of `JITTERS`.

    The values are tried in ascending order, as long as each one raises the log-likelihood by more
    than `JITTER_WORTH`.
    """
    best, best_loglik = 0.0, -np.inf
    for jitter in (0.0, *JITTERS):
        loglik = float(problem.loglik(theta, np.append(a[:3], jitter)).sum())
        if loglik > best_loglik + (JITTER_WORTH if best_loglik > -np.inf else 0.0):
            best, best_loglik = jitter, loglik
        else:
            break
    return np.append(a[:3], best)
