"""Full fits beside each other on a likelihood that is freed of its bias: ℓ less its false slope.

Where nothing but the base is there, the likelihood still has a slope on average: ḡ along the
parameters and s̄ along the log noise intensities (`estimate.bias_correction`), b along a
candidate's own (the mean of its scores over the nulls). To first order

    ℓ_c(θ, φ, a) = ℓ(θ, φ, a) − ḡ·(θ − θ_0) − b·(φ − φ_0) − s̄·(ln a − ln a_0) + ln prior

has none, so its maximum is where the estimating equation holds, and 2 Δℓ_c between two structures
is what a likelihood ratio should be. Maximised by Gauss and Newton, as in
`heli3dof.identification.greybox.maximum_likelihood`, with the noise's intensities along the way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.estimate.evaluation import Evaluation, evaluate, held
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import NOISE_HIGH, NOISE_LOW, Optimum

ROUNDS = 14
TOLERANCE = 0.02
"""Of the log-likelihood."""
NOISE_SETTLED = 0.06
SURE = 2.0


@dataclass(frozen=True, eq=False)
class ScoreBias:
    """The false slopes, and where they were seen."""

    theta: np.ndarray
    """(n,) ḡ and b, per coordinate"""
    log_noise: np.ndarray
    """(3,) s̄"""
    theta_0: np.ndarray
    noise_0: np.ndarray

    def of(self, theta: np.ndarray, noise: np.ndarray) -> float:
        """What is to be taken off the log-likelihood there."""
        ratio = np.log(noise[:3] / self.noise_0[:3])
        return float(self.theta @ (theta - self.theta_0) + self.log_noise @ ratio)


def maximise_corrected(
    problem: Likelihood, start: np.ndarray, noise: np.ndarray, tilt: ScoreBias | None, *,
    rounds: int = ROUNDS, hold_noise: bool = False, hold: np.ndarray | None = None,
) -> Optimum:  # fmt: skip
    """The maximum of ℓ_c near ``start`` (n,) and ``noise`` (4,); of ℓ without a tilt.

    ``hold`` (n,) bool: coordinates that stay where they start.
    """
    if tilt is None:
        tilt = ScoreBias(np.zeros(len(start)), np.zeros(3), start, noise)
    low, high = problem.bounds
    theta, a = np.clip(start, low, high), noise.copy()
    precision = problem.prior_precision
    axes = problem.free_noise
    still = held(problem) if hold is None else held(problem) | hold
    lam, moved, settled = 1e-3, 0.0 if hold_noise else np.inf, False

    def worth(loglik: np.ndarray, theta: np.ndarray, a: np.ndarray) -> float:
        return float(loglik.sum()) + problem.log_prior(theta) - tilt.of(theta, a)

    here: Evaluation = evaluate(problem, theta, a, whole=not hold_noise)
    for count in range(1, rounds + 1):
        if count > 1:
            again = not hold_noise and (moved > NOISE_SETTLED or count % 4 == 0)
            here = evaluate(problem, theta, a, whole=again)
        value = worth(here.at.loglik, theta, a)
        g = here.g - tilt.theta - precision * (theta - problem.prior_mean)
        A = here.H + np.diag(precision)
        go = ~(((theta <= low) & (g < 0)) | ((theta >= high) & (g > 0)))
        go &= ~still
        gain, accepted = 0.0, False
        for _ in range(10):
            damped = A[np.ix_(go, go)] + lam * np.diag(np.diag(A)[go])
            delta = np.zeros(len(theta))
            delta[go] = np.linalg.solve(damped, g[go])
            gain = 0.5 * float(g[go] @ delta[go])
            if gain < TOLERANCE:
                accepted = True
                break
            new = np.clip(theta + delta, low, high)
            there = -np.inf
            if gain > SURE:
                there = worth(problem.run(new, a, keep=0).loglik, new, a)
            if gain <= SURE or there > value:
                theta, accepted = new, True
                lam = max(lam / 10, 1e-9)
                break
            lam *= 10
        if here.slope.any():
            bend = np.minimum(here.bend, -1.0)
            move = np.clip(-(here.slope - tilt.log_noise) / bend, -0.7, 0.7)
            move = np.where(axes, move, 0.0)
            moved = float(np.abs(move).max())
            if moved > NOISE_SETTLED:
                a = a.copy()
                a[:3] = np.clip(a[:3] * np.exp(move), NOISE_LOW, NOISE_HIGH)
        settled = accepted and gain < TOLERANCE and moved <= NOISE_SETTLED
        if settled or not accepted:
            break
    return Optimum(
        theta, a, worth(here.at.loglik, theta, a), here.H, here.at, here.T,
        (theta <= low) | (theta >= high), count, settled,
    )  # fmt: skip
