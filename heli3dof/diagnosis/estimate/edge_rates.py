"""Estimates where encoders chatter: scores, noise slopes and rates of flights, weighed (GMM).

Where an encoder chatters in the loop, the filter's score and its slope along the noise hardly tell
less inertia under more noise from the rig that flew: what they are on average changes little along
that ridge. The rate at which the encoder's counts change does change, and the filter's likelihood
makes no use of it. So with y = (θ, ln a), the n coordinates and three noise intensities, and of
each flight the n + 6 moments

    m = (g, ∂ℓ/∂ln a, r)       of the recordings m, of flights b = 1 … B at y m_b
    r_i = Σ_k [y_i,k+1 ≠ y_i,k] / N       of N samples the share at which count i changes
    G = ∂ mean m_b/∂y          the filter held where it is, the rig that flies moved

there are three more equations than unknowns, and the estimate is (Hansen 1982; Gallant and Tauchen
1996)

    Gᵀ W (m − mean m_b) − Λ(y − y_0) = 0
    y ← y + A⁻¹ [Gᵀ W (m − mean m_b) − Λ(y − y_0)],      A = Gᵀ W G + Λ
    cov y = A⁻¹ (Gᵀ W (1 + 1/B) C W G + Λ) A⁻¹,          C = cov m_b

W is the inverse of C within each axis' three (g_j, slope, rate), elsewhere of its diagonal. G is
measured there, not believed: in the first rounds the flights' inertias and noises are moved up and
down by a two-level design, whose columns are orthogonal to each other and to the mean, so that each
effect is half the difference of two means. Elsewhere it is the filter's own H.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import (
    NEAR,
    CorrectedFit,
    model_at,
    optimum_at,
    scatter_of,
    simulate_again,
)
from heli3dof.diagnosis.estimate.evaluation import evaluate
from heli3dof.diagnosis.estimate.limit_cycle import edge_rates
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import NOISE_HIGH, NOISE_LOW
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

FLIGHTS = 24
"""Of each round; a multiple of 8"""
DESIGNED = 3
"""Rounds whose flights are moved"""
ROUNDS = 6
GAIN = 0.5
"""Share of the step that is taken in the others: flights that chatter have little in common from
round to round, and what is left is averaged."""
MOVED_J = (0.02, 0.15)
"""Least and most by which ln J is moved; two of the noise model's standard deviations between."""
MOVED_NOISE = 0.4
"""And ln a"""
LONGEST_J, LONGEST_NOISE = 0.3, 0.7
"""Of one step"""
RIDGE = 0.1
"""Of a moment's variance, added to it in W: few flights, and rigs that are not quite the model."""
INERTIAS = np.arange(1, 4)
"""Which coordinates they are"""


@dataclass(frozen=True, eq=False)
class Round:
    """The recordings and B flights at one point."""

    apart: np.ndarray
    """(n + 6,) m − mean m_b"""
    C: np.ndarray
    """(n + 6, n + 6) covariance of m_b, less what moved them"""
    H: np.ndarray
    effects: np.ndarray | None
    """(6, n + 6) ∂ mean m_b by the inertias' and the noises' logarithms; None: not moved"""
    scores: np.ndarray
    """(B, n)"""
    slopes: np.ndarray
    """(3,) mean ∂ℓ/∂ln a of the flights"""


def fit_with_edge_rates(
    problem: Likelihood, near: CorrectedFit, recordings: Sequence[Recording], *, seed: int,
    flights: int = FLIGHTS, rounds: int = ROUNDS,
) -> CorrectedFit:  # fmt: skip
    """The estimate from ``near`` it; ``near`` itself where its flights are lost."""
    n = len(near.theta)
    rest = near.optimum.noise[3:]
    y = np.concatenate([near.theta, np.log(near.optimum.noise[:3])])
    low, high = problem.bounds
    low, high = np.append(low, [np.log(NOISE_LOW)] * 3), np.append(high, [np.log(NOISE_HIGH)] * 3)
    precision = np.append(problem.prior_precision, np.zeros(3))
    prior = np.append(problem.prior_mean, np.zeros(3))
    longest = np.full(n + 3, np.inf)
    longest[INERTIAS], longest[n:] = LONGEST_J, LONGEST_NOISE
    G, W, C = (np.zeros((n + 6, m)) for m in (n + 3, n + 6, n + 6))
    settled, count = False, 0
    while count < rounds and not settled:
        moved = count < DESIGNED
        at = flown(problem, y, rest, recordings, (seed, 19), flights, moved=moved, what=count + 1)
        if not (np.isfinite(y).all() and np.isfinite(at.apart).all()):
            return near
        # What earlier rounds of the same kind showed is not thrown away.
        share = 1 / (1 + (count if moved else count - DESIGNED))
        C = (1 - share) * C + share * at.C
        if at.effects is not None:
            G = (1 - share) * G + share * jacobian(at.H, at.effects)
            W = weights(C)
        B = G.T @ W
        inverse = np.linalg.inv(B @ G + np.diag(precision))
        V = inverse @ ((1 + 1 / flights) * B @ C @ B.T + np.diag(precision)) @ inverse.T
        step = inverse @ (B @ at.apart - precision * (y - prior))
        step *= 1.0 if moved else GAIN
        settled = not moved and float(np.abs(step / np.sqrt(np.diag(V))).max()) < NEAR
        y = np.clip(y + np.clip(step, -longest, longest), low, high)
        count += 1
    theta, noise = y[:n], np.append(np.exp(y[n:]), rest)
    optimum = optimum_at(problem, theta, noise, near.optimum.rounds + count, settled)
    C = scatter_of(at.scores, optimum.information)
    return CorrectedFit(problem, optimum, C, at.scores.mean(axis=0), at.slopes, flights, V[:n, :n])


def flown(
    problem: Likelihood, y: np.ndarray, rest: np.ndarray, recordings: Sequence[Recording],
    seed: tuple[int, ...], flights: int, *, moved: bool, what: int,
) -> Round:  # fmt: skip
    """One round at y (n + 3,), with its flights moved by the design or not."""
    n = len(y) - 3
    theta, noise = y[:n], np.append(np.exp(y[n:]), rest)
    here = evaluate(problem, theta, noise)
    sd = np.sqrt(np.diag(np.linalg.inv(here.H + np.diag(problem.prior_precision))))
    size = np.append(np.clip(2 * sd[INERTIAS], *MOVED_J), [MOVED_NOISE] * 3)
    signs = design(flights)

    def one(b: int) -> tuple[np.ndarray, np.ndarray]:
        z = y.copy()
        if moved:
            z[[*INERTIAS, n, n + 1, n + 2]] += size * signs[b]
        model = model_at(problem, z[:n], np.append(np.exp(z[n:]), rest))
        data = simulate_again(model, recordings, problem.data, (*seed, b))
        seen = evaluate(replace(problem, data=data), theta, noise)
        return np.concatenate([seen.g, seen.slope, edge_rates(data)]), seen.H

    out = parallel_map(one, flights, what=f"flights, weighed, round {what}")
    m = np.array([m for m, _ in out])
    mean = m.mean(axis=0)
    effects = signs.T @ m / flights if moved else np.zeros((6, n + 6))
    left = m - mean - signs @ effects
    C = left.T @ left / (flights - (7 if moved else 1))
    H = 0.5 * (here.H + np.mean([h for _, h in out], axis=0))
    apart = np.concatenate([here.g, here.slope, edge_rates(problem.data)]) - mean
    return Round(apart, C, H, effects / size[:, None] if moved else None, m[:, :n], mean[n : n + 3])


def design(flights: int) -> np.ndarray:
    """(B, 6) of ±1: columns orthogonal to each other and to the mean, eight rows at a time; every
    other eight is turned over, so that no effect is mistaken for two others' product.

    >>> X = design(16)
    >>> bool((X.T @ X == 16 * np.eye(6)).all()), float(abs(X.sum(axis=0)).max())
    (True, 0.0)
    """
    from scipy.linalg import hadamard

    eight = hadamard(8)[:, 1:7].astype(float)
    return np.concatenate([eight * (-1) ** k for k in range(flights // 8)])


def jacobian(H: np.ndarray, effects: np.ndarray) -> np.ndarray:
    """(n + 6, n + 3) G: H, and in each axis' three moments what the flights showed (6, n + 6)."""
    n = len(H)
    G = np.zeros((n + 6, n + 3))
    G[:n, :n] = H
    for i in range(3):
        G[moments_of_axis(i, n), 1 + i] = effects[i, moments_of_axis(i, n)]
        G[moments_of_axis(i, n), n + i] = effects[3 + i, moments_of_axis(i, n)]
    return G


def weights(C: np.ndarray) -> np.ndarray:
    """(n + 6, n + 6) W.

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
    """Where axis i's score along its inertia, its noise slope and its rate stand."""
    return [1 + i, n + i, n + 3 + i]
