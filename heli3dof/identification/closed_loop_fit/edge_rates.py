"""Fit parameters and noise of a rig on a limit cycle by the generalised method of moments.

On a limit cycle, a smaller inertia with more noise has nearly the same expected score as the true
rig. But the encoder counts then change at other rates, so the fit also matches these *edge rates*.
For y = (θ, ln a), with n scaled parameters θ and three noise intensities a, the n + 6 moments are

    m = (g, ∂ℓ/∂ln a, r)         g = ∂ℓ/∂θ: score, ℓ: the filter's log-likelihood (`evaluation`)
    r_i                          edge rate: share of samples at which encoder i's count changes
    G = ∂ mean m_b/∂y            derivative with respect to the simulated rig's y; filter's y fixed

m are the moments of the recordings, m_b those of flight b of B flights simulated at y. The estimate
solves (Hansen 1982; simulated moments: Gallant and Tauchen 1996)

    Gᵀ W (m − mean m_b) − Λ(y − y_0) = 0               y_0, Λ: the prior's mean and information
    y ← y + A⁻¹ [Gᵀ W (m − mean m_b) − Λ(y − y_0)],      A = Gᵀ W G + Λ
    cov y = A⁻¹ (Gᵀ W (1 + 1/B) C W G + Λ) A⁻¹,          C = cov m_b

Three of the n + 6 moments belong to each axis: the score of its inertia, its ∂ℓ/∂ln a and its edge
rate. The other n − 3 are the scores of the other parameters. To compute W, all covariances in C are
set to zero, except those between two moments of the same axis. Then the variances are increased by
the fraction `RIDGE`, and the matrix is inverted. G consists of three parts:

- the derivatives of an axis' three moments with respect to the inertia and the noise of this axis.
  They are estimated in the first rounds, in which inertias and noises of the simulated flights
  follow a two-level factorial design
- the other derivatives of the scores with respect to θ, which are the Fisher information H of θ
- zeros elsewhere
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.identification.bias_correction.correction import (
    CONVERGED,
    CorrectedFit,
    model_at,
    optimum_at,
    scatter_of,
    simulate_again,
)
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.closed_loop_fit.limit_cycle import edge_rates
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import NOISE_HIGH, NOISE_LOW
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording

FLIGHTS = 24  # simulated flights per round; a multiple of 8
DESIGN_ROUNDS = 3  # the first rounds, which use the two-level design
ROUNDS = 10
"""Largest number of rounds. Of seven flights of the plan ``steps``, four converged within six
rounds, three in the seventh."""
GAIN = 0.5  # share of the step that the other rounds take, chosen
DESIGN_STEP_J = (0.02, 0.15)
"""Limits of the design's step of ln J: two standard deviations of ln J, clipped to these limits"""
DESIGN_STEP_NOISE = 0.4  # the design's step of ln a, chosen
MAX_STEP_J, MAX_STEP_NOISE = 0.3, 0.7  # largest steps of ln J and ln a in a round, chosen
RIDGE = 0.1
"""Relative increase of the moments' variances in W, because few flights give C. Chosen."""
INERTIAS = np.arange(1, 4)  # indices in θ


@dataclass(frozen=True, eq=False)
class Round:
    """The result of an iteration: the moments of the recordings and of B simulated flights.

    The n + 6 moments of a flight are its scores ∂ℓ/∂θ, its derivatives ∂ℓ/∂ln a, and its three
    edge rates (shares of samples at which an encoder's count changes). ℓ is the log-likelihood, θ
    are n scaled parameters, a the process noises of three axes.
    """

    difference: np.ndarray
    """(n + 6,) the recordings' moments minus the flights' mean moments"""
    C: np.ndarray
    """(n + 6, n + 6) covariance of the flights' moments, without the effects of the design"""
    H: np.ndarray
    """(n, n) information of the scaled parameters"""
    effects: np.ndarray | None
    """(6, n + 6) derivatives of the mean moments with respect to the logarithms of three inertias
    and of three noise intensities; None for a round without the two-level design"""
    scores: np.ndarray
    """(B, n) scores of the flights"""
    slopes: np.ndarray
    """(3,) the flights' mean ∂ℓ/∂ln a"""


def fit_with_edge_rates(
    problem: Likelihood, start: CorrectedFit, recordings: Sequence[Recording], *, seed: int,
    flights: int = FLIGHTS, rounds: int = ROUNDS,
) -> CorrectedFit:  # fmt: skip
    """Return a fit that also matches the edge rates (how often the encoder counts change).

    The search starts at the fit ``start``. If it diverges, or if the simulated flights diverge, the
    result is ``start``.
    """
    n = len(start.theta)
    jitter = start.optimum.noise[3:]
    y = np.concatenate([start.theta, np.log(start.optimum.noise[:3])])
    low, high = problem.bounds
    low, high = np.append(low, [np.log(NOISE_LOW)] * 3), np.append(high, [np.log(NOISE_HIGH)] * 3)
    precision = np.append(problem.prior_precision, np.zeros(3))
    prior = np.append(problem.prior_mean, np.zeros(3))
    max_step = np.full(n + 3, np.inf)
    max_step[INERTIAS], max_step[n:] = MAX_STEP_J, MAX_STEP_NOISE
    G, W, C = (np.zeros((n + 6, m)) for m in (n + 3, n + 6, n + 6))
    converged, count = False, 0
    while count < rounds and not converged:
        designed = count < DESIGN_ROUNDS
        at = simulated_round(
            problem, y, jitter, recordings, (seed, 19), flights, designed=designed, number=count + 1
        )
        if not (np.isfinite(y).all() and np.isfinite(at.difference).all()):
            return start
        # C is a mean over the rounds with design, later over those without; G over those with.
        share = 1 / (1 + (count if designed else count - DESIGN_ROUNDS))
        C = (1 - share) * C + share * at.C
        if at.effects is not None:
            G = (1 - share) * G + share * jacobian(at.H, at.effects)
            W = weights(C)
        B = G.T @ W
        inverse = np.linalg.inv(B @ G + np.diag(precision))
        V = inverse @ ((1 + 1 / flights) * B @ C @ B.T + np.diag(precision)) @ inverse.T
        step = inverse @ (B @ at.difference - precision * (y - prior))
        step *= 1.0 if designed else GAIN
        converged = not designed and float(np.abs(step / np.sqrt(np.diag(V))).max()) < CONVERGED
        y = np.clip(y + np.clip(step, -max_step, max_step), low, high)
        count += 1
    theta, noise = y[:n], np.append(np.exp(y[n:]), jitter)
    optimum = optimum_at(problem, theta, noise, start.optimum.rounds + count, converged)
    if not np.isfinite(optimum.loglik):
        return start
    C = scatter_of(at.scores, optimum.information)
    return CorrectedFit(problem, optimum, C, at.scores.mean(axis=0), at.slopes, flights, V[:n, :n])


def simulated_round(
    problem: Likelihood, y: np.ndarray, jitter: np.ndarray, recordings: Sequence[Recording],
    seed: tuple[int, ...], flights: int, *, designed: bool, number: int,
) -> Round:  # fmt: skip
    """Simulate flights with the parameters ``y``; compare their moments with the recordings'.

    The moments of a flight are its n scores, three derivatives ∂ℓ/∂ln a of its log-likelihood ℓ,
    and three edge rates (shares of samples at which an encoder's count changes). ``y`` (n + 3,) is
    (θ, ln a): n scaled parameters θ, and logarithms of the process noise a of three axes.
    ``jitter`` (1,) is the sampling jitter (s), ``flights`` the number of simulated flights. If
    ``designed``, a two-level `design` varies their inertias and noises. ``number`` is the number of
    this round in the progress message.
    """
    n = len(y) - 3
    theta, noise = y[:n], np.append(np.exp(y[n:]), jitter)
    recorded = evaluate(problem, theta, noise)
    sd = np.sqrt(np.diag(np.linalg.inv(recorded.H + np.diag(problem.prior_precision))))
    size = np.append(np.clip(2 * sd[INERTIAS], *DESIGN_STEP_J), [DESIGN_STEP_NOISE] * 3)
    signs = design(flights)

    def one(b: int) -> tuple[np.ndarray, np.ndarray]:
        z = y.copy()
        if designed:
            z[[*INERTIAS, n, n + 1, n + 2]] += size * signs[b]
        model = model_at(problem, z[:n], np.append(np.exp(z[n:]), jitter))
        data = simulate_again(model, recordings, problem.data, (*seed, b))
        at = evaluate(replace(problem, data=data), theta, noise)
        return np.concatenate([at.g, at.slope, edge_rates(data)]), at.H

    out = replicate(one, flights, what=f"flights for the weighted fit, round {number}")
    m = np.array([m for m, _ in out])
    mean = m.mean(axis=0)
    effects = signs.T @ m / flights if designed else np.zeros((6, n + 6))
    residuals = m - mean - signs @ effects
    C = residuals.T @ residuals / (flights - (7 if designed else 1))
    H = 0.5 * (recorded.H + np.mean([h for _, h in out], axis=0))
    difference = np.concatenate([recorded.g, recorded.slope, edge_rates(problem.data)]) - mean
    derivatives = effects / size[:, None] if designed else None
    return Round(difference, C, H, derivatives, m[:, :n], mean[n : n + 3])


def design(flights: int) -> np.ndarray:
    """Return the two-level design (B, 6) of ±1, with B = ``flights``.

    Each block of eight rows consists of six orthogonal columns of an 8 × 8 Hadamard matrix. Every
    second block has opposite signs (foldover), so interactions bias the main effects less.

    >>> X = design(16)
    >>> bool((X.T @ X == 16 * np.eye(6)).all()), float(abs(X.sum(axis=0)).max())
    (True, 0.0)
    """
    from scipy.linalg import hadamard

    eight = hadamard(8)[:, 1:7].astype(float)
    return np.concatenate([eight * (-1) ** k for k in range(flights // 8)])


def jacobian(H: np.ndarray, effects: np.ndarray) -> np.ndarray:
    """Return the Jacobian G (n + 6, n + 3) of the mean moments of simulated flights.

    The moments of a flight are m = (∂ℓ/∂θ, ∂ℓ/∂ln a, r). ℓ is the log-likelihood, θ (n,) are the
    scaled parameters, a (3,) the process noises of three axes. r (3,) are the edge rates: shares of
    samples at which an encoder's count changes. The columns of G are the derivatives of the mean m
    with respect to θ and ln a of the simulated rig.

    ``H`` (n, n) is the Fisher information of θ, which equals the derivatives of the mean scores
    ∂ℓ/∂θ with respect to θ. ``effects`` (6, n + 6) contains estimates of further derivatives of m:
    rows 0 to 2 with respect to the logarithms of the three inertias, rows 3 to 5 with respect to
    ln a. Three moments belong to each axis (`moments_of_axis`). G takes from ``effects`` only their
    derivatives with respect to the inertia and the noise of the same axis. The other elements of G
    are those of H, or zero.
    """
    n = len(H)
    G = np.zeros((n + 6, n + 3))
    G[:n, :n] = H
    for i in range(3):
        G[moments_of_axis(i, n), 1 + i] = effects[i, moments_of_axis(i, n)]
        G[moments_of_axis(i, n), n + i] = effects[3 + i, moments_of_axis(i, n)]
    return G


def weights(C: np.ndarray) -> np.ndarray:
    """Return the weight matrix W (n + 6, n + 6) of the moments, from their covariance C.

    The moments of a flight are n scores, three noise derivatives and three edge rates. Three of
    them belong to each axis: the score of its inertia, its noise derivative and its edge rate
    (`moments_of_axis`). W is the inverse of C, after two changes of C:

    - Each variance is increased by the fraction `RIDGE`.
    - The covariance of two moments is set to zero, unless both belong to the same axis.

    >>> bool(np.allclose(weights(4 * np.eye(10)), np.eye(10) / 4.4))
    True
    """
    n = len(C) - 6
    D = np.maximum(np.diag(C), 1e-300)
    W = np.diag(1 / ((1 + RIDGE) * D))
    for i in range(3):
        block = np.ix_(moments_of_axis(i, n), moments_of_axis(i, n))
        W[block] = np.linalg.inv(C[block] + np.diag(RIDGE * D[moments_of_axis(i, n)]))
    return W


def moments_of_axis(i: int, n: int) -> list[int]:
    """Return the indices of the three moments that belong to axis i, in the vector of moments.

    The vector (n + 6,) contains n scores, then three noise derivatives, then three edge rates. A
    score is the derivative of the log-likelihood with respect to a parameter. A noise derivative is
    that with respect to the logarithm of an axis' process noise. An edge rate is the share of
    samples at which an axis' encoder count changes. The moments of axis i are the score of its
    inertia, its noise derivative and its edge rate.
    """
    return [1 + i, n + i, n + 3 + i]
