"""Maximum likelihood by Gauss–Newton on the innovations, the noise estimated along the way.

Each round: the filter at θ; a Newton step of each axis' log noise intensity, from the likelihood
at three intensities (axis by axis: they hardly mix); then with gains held the tangents ∂m/∂θ, and

    (H + Λ + λ diag H) δ = Σ g ∂m − Λ (θ − θ_0),     H = Σ w ∂m ∂mᵀ,   Λ the prior's precision

(Levenberg and Marquardt's λ grows until the likelihood does), cut to the bounds. Done when half
the Newton decrement, the likelihood still to be won, is below `TOLERANCE`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.identification.greybox.likelihood import (
    Likelihood,
    Pass,
    score_and_information,
)
from heli3dof.parallel import in_threads

TOLERANCE = 2e-3
"""Of the log-likelihood: a step of 0.06 standard deviations."""
ROUNDS = 25
OTHER_ROUNDS = 12
"""For starts beside the first, which are tried where that does not settle."""
SURE = 3.0
"""A step that wins no more than this is taken without asking the likelihood, which is rough at
that scale (its terms in P are left out of the score; their expectation is zero)."""
AT_ONCE = 5
"""Rounds of whole steps. A joint that sticks or slips makes the score as rough as a tenth of a
standard deviation, and whole steps circle for ever. After these a step that turns back on the one
before shortens all that follow, the n-th time to 1/(n + 1) of one (Kesten, 1958): they end at the
middle of the roughness, and where the way only was long it is walked to its end."""
NOISE_SETTLED = 0.05
"""Of the log intensity."""
NOISE_START = (0.03, 0.06, 0.02, 0.0)
"""rad/s²/√Hz, roll, pitch, yaw: several times a quiet rig's, so that a poor start is survived;
and s, the jitter of the sampling instants."""
NOISE_LOW, NOISE_HIGH = 1e-5, 30.0
JITTERS = (0.001, 0.002, 0.004, 0.008)
"""s; tried in turn, in the rounds `JITTER_ROUNDS`."""
JITTER_ROUNDS = (2, 5)
JITTER_WORTH = 10.0
_PROBE = 0.5  # step of the log intensity


@dataclass(frozen=True, eq=False)
class Optimum:
    """Where the search ended."""

    theta: np.ndarray
    """(n,) coordinates"""
    noise: np.ndarray
    """(4,) rad/s²/√Hz on roll, pitch, yaw; s of jitter"""
    loglik: float
    """Σ ln Z + ln prior"""
    information: np.ndarray
    """(n, n) of the likelihood alone, in coordinates"""
    at: Pass
    tangents: np.ndarray
    """(n, N, 3)"""
    at_bound: np.ndarray
    """(n,) bool"""
    rounds: int
    converged: bool


def maximise(
    problem: Likelihood,
    start: np.ndarray | None = None,
    noise: np.ndarray | None = None,
    *,
    rounds: int = ROUNDS,
) -> Optimum:
    """The maximum near ``start`` (n,) coordinates (the prior's mean) and ``noise`` (3,)."""
    low, high = problem.bounds
    theta = problem.prior_mean.copy() if start is None else np.clip(start, low, high)
    a = np.array(NOISE_START if noise is None else noise, dtype=float)
    axes = problem.data.axes
    precision = problem.prior_precision
    lam = 1e-3
    settled = False
    moved = np.inf
    turns, last = 0, np.zeros(len(theta))
    for count in range(1, rounds + 1):
        if moved > NOISE_SETTLED or count % 4 == 0:
            a, moved = better_noise(problem, theta, a, axes)
        if count in JITTER_ROUNDS:
            a = _better_jitter(problem, theta, a)
        at = problem.run(theta, a)
        here = float(at.loglik.sum()) + problem.log_prior(theta)
        D = problem.tangents(theta, at)
        g, H = score_and_information(at, D)
        g = g - precision * (theta - problem.prior_mean)
        A = H + np.diag(precision)
        stuck = ((theta <= low) & (g < 0)) | ((theta >= high) & (g > 0))
        go = ~stuck
        gain, part = 0.0, 1.0
        accepted = False
        for tried in range(12):
            damped = A[np.ix_(go, go)] + lam * np.diag(np.diag(A)[go])
            delta = np.zeros(len(theta))
            delta[go] = np.linalg.solve(damped, g[go])
            gain = 0.5 * float(g[go] @ delta[go])
            if not tried:
                turns += count > AT_ONCE and gain <= SURE and bool(last @ A @ delta < 0)
                last = delta
            part = 1.0 / (1 + turns) if gain <= SURE else 1.0
            if gain * part**2 < TOLERANCE:
                accepted = True
                break
            new = np.clip(theta + part * delta, low, high)
            there = -np.inf
            if gain > SURE:
                trial = problem.run(new, a, keep=0)
                there = float(trial.loglik.sum()) + problem.log_prior(new)
            if gain <= SURE or there > here:
                theta, accepted = new, True
                lam = max(lam / 10, 1e-9)
                break
            lam *= 10
        settled = accepted and gain * part**2 < TOLERANCE and moved <= NOISE_SETTLED
        if settled or not accepted:
            break
    # At a small last step the pass and the tangents are those of the optimum.
    g, H = score_and_information(at, D)
    return Optimum(theta, a, here, H, at, D, (theta <= low) | (theta >= high), count, settled)


def better_noise(
    problem: Likelihood, theta: np.ndarray, a: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, float]:
    """One Newton step of the log intensities; the largest move made.

    The likelihood is a little rough (the filter decides when to look), so its slope and bend are
    taken over a factor of e^`_PROBE` either way.
    """
    factor = np.array([np.exp(_PROBE)] * 3 + [1.0])
    at = (a, a * factor, a / factor)
    mid, up, down = in_threads(lambda i: problem.run(theta, at[i], keep=0).loglik, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (up - down) / (2 * _PROBE)
        bend = -(up - 2 * mid + down) / _PROBE**2
        move = np.where(bend > 0, slope / bend, np.sign(slope))
    move = np.where(axes & np.isfinite(move), np.clip(move, -0.7, 1.0), 0.0)
    better = np.clip(a[:3] * np.exp(move), NOISE_LOW, NOISE_HIGH)
    return np.append(better, a[3]), float(np.abs(move).max())


def _better_jitter(problem: Likelihood, theta: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The noise with the likeliest jitter; none unless it is worth `JITTER_WORTH`."""
    best, best_loglik = 0.0, -np.inf
    for jitter in (0.0, *JITTERS):
        loglik = float(problem.run(theta, np.append(a[:3], jitter), keep=0).loglik.sum())
        if loglik > best_loglik + (JITTER_WORTH if best_loglik > -np.inf else 0.0):
            best, best_loglik = jitter, loglik
        else:
            break
    return np.append(a[:3], best)
