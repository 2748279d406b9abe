"""Correct the bias of a fit by simulated flights: the efficient method of moments.

The filter's likelihood assumes Gaussian distributions, but encoders quantise. So at the true
parameters, the score (the gradient of the log-likelihood) has a nonzero mean, and the maximum of
the likelihood is biased. If an axis is in a limit cycle between two encoder counts, its inertia has
the largest bias. If the controller is known, `correct` simulates B flights of the fitted model
(`bias_correction.simulated_flight`). Let g (n,) be the score of the recordings and g_b that of
flight b, both at the parameters θ (n,). H_r (n, n) is the recordings' information; H is the mean of
H_r and the flights' mean information. θ_0 and Λ are the prior's mean and information:

    g(θ) − ḡ(θ) − Λ(θ − θ_0) = 0,      ḡ = mean g_b                     (estimating equation)
    θ ← θ + (H + Λ)⁻¹ (g − ḡ − Λ(θ − θ_0))
    cov θ = (H_r + Λ)⁻¹ ((1 + 1/B) C + Λ) (H_r + Λ)⁻¹,      C = cov g_b by `scatter_of`

In the same way, s̄ = mean s_b corrects s, the log-likelihood's derivatives with respect to the
logarithms of the three noise intensities. Noise that is correlated over time (coloured) increases
the variance of parameter i by a factor ρ_i (`bias_correction.coloured_noise`). So element ij of
cov θ is multiplied by √(ρ_i ρ_j).
Sources: Gallant and Tauchen (1996); Gouriéroux, Monfort and Renault (1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from heli3dof.identification.bias_correction.coloured_noise import colour
from heli3dof.identification.bias_correction.corrected_maximum import maximise_corrected
from heli3dof.identification.bias_correction.evaluation import evaluate, fixed_parameters
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.identification.greybox.estimate import Estimate, cramer_rao
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.maximum_likelihood import Optimum, damped_step, scaled_noise
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording

MAX_INFLATION = 1.2
"""κ (`greybox.estimate`) above which the scores scatter more than the noise model allows. For a
valid likelihood κ is near 1. Its standard deviation is √(2/(n m)) = 0.04 for n = 12 parameters and
m = 120 blocks (a minute); 1.2 is 1 plus five of these."""
ROUNDS = 10
"""Largest number of rounds, unless the caller gives another. Chosen."""
CONVERGED = 0.35
"""The search ends at a step of θ below this many standard deviations. It is about 1/√8: the
standard error of the mean ḡ of eight flights, in standard deviations of one flight's score."""
NOISE_CONVERGED = 0.1  # largest step of ln a at the end of the search, chosen
REUSED_WITHIN = 0.3, 3.0
"""Two limits: of the change of ln a (a: process noise of an axis), and of the change of a parameter
in standard deviations. Below both, s̄ is not computed again, which saves two filter runs per flight.
Chosen."""
DIVERGED, DIVERGED_AFTER = 30.0, 3
"""From round `DIVERGED_AFTER` on, a step of θ above `DIVERGED` standard deviations ends the search:
the controller may not stabilise the fitted rig. Chosen."""
MAX_SCATTER = 1e4
"""Largest C_jj/H_jj. Above it, standard deviations exceed a hundred times those of the likelihood,
so the simulated flights have diverged, and the search has failed. Chosen."""


@dataclass(frozen=True, eq=False)
class CorrectedFit(Estimate):
    """A bias-corrected fit; its covariance follows from the simulated flights (see the module)."""

    score_covariance: np.ndarray | None = None
    """(n, n) C; None if no flights were simulated: the covariance is then that of `Estimate`"""
    bias: np.ndarray | None = None
    """(n,) ḡ; None: zero"""
    noise_bias: np.ndarray | None = None
    """(3,) s̄, the log-likelihood's mean derivatives with respect to the logarithms of the process
    noise of roll, pitch and yaw; None: zero"""
    flights: int = 0
    """B, the simulated flights of a round; 0: none"""
    covariance_with_edge_rates: np.ndarray | None = None
    """(n, n) covariance of θ of a fit with edge rates (`closed_loop_fit.edge_rates`), else None"""

    @property
    def is_corrected(self) -> bool:
        """Return True if the bias was corrected, by simulated flights of the fitted model."""
        return self.score_covariance is not None

    @property
    def score_bias(self) -> np.ndarray:
        """Return ḡ (n,), the mean score of simulated flights; zero if none were simulated."""
        return super().score_bias if self.bias is None else self.bias

    @cached_property
    def coloured_noise_factor(self) -> np.ndarray:
        """Return the factors ρ (n,) of `coloured_noise`; 1 if no flights were simulated."""
        if self.score_covariance is None:
            return np.ones(len(self.optimum.theta))
        return colour(self, self.score_covariance)

    @cached_property
    def covariance(self) -> np.ndarray:
        """Return the covariance (n, n) of the parameters in their units."""
        if self.score_covariance is None:
            return super().covariance
        scale = self.slopes * np.sqrt(self.coloured_noise_factor)
        if self.covariance_with_edge_rates is not None:
            return np.asarray(self.covariance_with_edge_rates * np.outer(scale, scale))
        L = np.diag(self.problem.prior_precision)
        inverse = np.linalg.inv(self.optimum.information + L)
        middle = (1 + 1 / self.flights) * self.score_covariance + L
        return np.asarray(inverse @ middle @ inverse * np.outer(scale, scale))

    @cached_property
    def bound(self) -> np.ndarray:
        """Return the Cramér–Rao bound (n,) on the standard deviations, in the parameters' units."""
        if self.score_covariance is None:
            return super().bound
        return np.asarray(cramer_rao(self.problem, self.theta, self.optimum.noise) * self.slopes)

    @cached_property
    def unexplained_scatter(self) -> float:
        """Return the mean factor by which coloured noise increases the parameters' variances.

        If no flights were simulated, the factors are unknown. The result is then `inflation`, the
        ratio of the scores' actual variance to the variance that the noise model expects.
        """
        return float(self.coloured_noise_factor.mean()) if self.is_corrected else self.inflation


def model_at(problem: Likelihood, theta: np.ndarray, noise: np.ndarray) -> GreyBoxModel:
    """Return the model with the scaled parameters ``theta`` (n,) and the ``noise`` (4,).

    ``noise``: process noise of three axes, jitter. The covariance of the model's parameters is NaN.
    """
    n = len(theta)
    return GreyBoxModel(
        "null", problem.structure.profile, tuple(t.name for t in problem.structure.terms),
        problem.values(theta), noise[:3], np.full((n, n), np.nan), float(noise[3]),
    )  # fmt: skip


def simulate_again(
    model: GreyBoxModel, recordings: Sequence[Recording], data: Data, seed: Sequence[int]
) -> Data:
    """Return ``data`` with simulated flights of ``model`` in place of the recorded flights.

    The simulated flights have the references and controllers of ``recordings``. Equal ``seed``
    gives equal noise.
    """
    last_rows = [
        max((r.stop for r in data.runs if r.source == i), default=0) for i in range(len(recordings))
    ]
    rng = np.random.default_rng(list(seed))
    simulated = [
        simulated_flight(model, r, rng, rows=n) if n else r
        for r, n in zip(recordings, last_rows, strict=True)
    ]
    return data_of(simulated, data.runs)


Start = tuple[np.ndarray, np.ndarray]
"""Start of a search: scaled parameters (n,), and the noise (4,). The noise is the process noise of
roll, pitch and yaw (rad/s²/√Hz), then the sampling jitter (s)"""


def correct(
    problem: Likelihood,
    starts: Sequence[Start],
    recordings: Sequence[Recording],
    *,
    seed: int,
    flights_per_round: int,
    rounds: int = ROUNDS,
) -> CorrectedFit:
    """Return the fit at which the recordings' score equals the mean score of simulated flights.

    The search begins at the first of the ``starts``. If it diverges, it is repeated from the next
    one. If it diverges from all, the result is the maximum of the likelihood, without a correction
    (`CorrectedFit.is_corrected` is False). ``rounds``: largest number of rounds;
    ``flights_per_round``: number of flights simulated in each.
    """
    for start in starts:
        fit = corrected_from(
            problem, start, recordings,
            seed=seed, flights_per_round=flights_per_round, rounds=rounds,
        )  # fmt: skip
        if fit is not None:
            return fit
    optima = [maximise_corrected(problem, *start, None) for start in starts]
    return CorrectedFit(problem, max(optima, key=lambda o: o.loglik))


def corrected_from(
    problem: Likelihood, start: Start, recordings: Sequence[Recording], *,
    seed: int, flights_per_round: int, rounds: int,
) -> CorrectedFit | None:  # fmt: skip
    """Return the result of `correct` from one start; None if the search or its flights diverge."""
    theta, noise = start
    low, high = problem.bounds
    precision = problem.prior_precision
    axes = problem.free_noise
    n = len(theta)
    acceleration = AndersonAcceleration()
    noise_bias: NoiseScoreBias | None = None
    for count in range(1, rounds + 1):
        recorded = evaluate(problem, theta, noise)
        update = noise_bias is None or noise_bias.is_outdated(theta, noise)
        one = partial(flight_derivatives, problem, theta, noise, recordings, seed, update)
        flights = replicate(one, flights_per_round, what=f"flights, round {count}")
        scores, informations, slopes, curvatures = map(np.array, zip(*flights, strict=True))
        g = recorded.g - scores.mean(axis=0) - precision * (theta - problem.prior_mean)
        H = 0.5 * (recorded.H + informations.mean(axis=0))
        A = H + np.diag(precision)
        free = problem.movable(theta, g) & ~fixed_parameters(problem)
        step, _ = damped_step(A, g, free, 0.0)
        sd = np.sqrt(np.diag(np.linalg.inv(A)))
        if update:
            noise_bias = NoiseScoreBias(
                slopes.mean(axis=0), curvatures.mean(axis=0), theta, noise, sd
            )
        assert noise_bias is not None
        slope = recorded.slope - noise_bias.slope
        curvature = np.minimum(np.minimum(recorded.curvature, noise_bias.curvature), -1.0)
        noise_step = np.where(axes, np.clip(-slope / curvature, -0.7, 0.7), 0.0)
        length = float(np.abs(step / sd).max())
        if not np.isfinite(length) or (count >= DIVERGED_AFTER and length > DIVERGED):
            return None
        converged = bool(length < CONVERGED and np.abs(noise_step).max() < NOISE_CONVERGED)
        if not converged:
            if count == 1:
                scale = np.concatenate([sd, np.full(3, NOISE_CONVERGED / CONVERGED)])
            y = np.concatenate([theta, np.log(noise[:3])]) / scale
            accelerated = acceleration.step(y, np.concatenate([step, noise_step]) / scale) * scale
            step, noise_step = accelerated[:n], np.clip(accelerated[n:], -1.0, 1.0)
        # Without the last step, the result would be biased towards the start of the search.
        theta, noise = np.clip(theta + step, low, high), scaled_noise(noise, noise_step)
        if converged:
            break
    optimum = optimum_at(problem, theta, noise, count, converged)
    C = scatter_of(scores, optimum.information)
    if (np.diag(C) > MAX_SCATTER * np.diag(optimum.information)).any():
        return None
    assert noise_bias is not None
    return CorrectedFit(
        problem, optimum, C, scores.mean(axis=0), noise_bias.slope, flights_per_round
    )


def flight_derivatives(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, recordings: Sequence[Recording],
    seed: int, with_noise_derivatives: bool, b: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Return the fields g, H, slope and curvature of the `Evaluation` of simulated flight b.

    The flight is simulated and evaluated at ``theta`` (n,) and ``noise`` (4,).
    """
    model = model_at(problem, theta, noise)
    data = simulate_again(model, recordings, problem.data, (seed, 7, b))
    e = evaluate(
        replace(problem, data=data), theta, noise, with_noise_derivatives=with_noise_derivatives
    )
    return e.g, e.H, e.slope, e.curvature


@dataclass(frozen=True, eq=False)
class NoiseScoreBias:
    """Mean derivatives of the log-likelihood with respect to ln a (a: process noise by axis).

    The means are over flights simulated with the parameters ``theta`` and the ``noise``.
    """

    slope: np.ndarray
    """(3,) first derivatives s̄"""
    curvature: np.ndarray
    """(3,) second derivatives"""
    theta: np.ndarray
    """(n,) scaled parameters θ of the flights"""
    noise: np.ndarray
    """(4,) noise of the flights: process noise of three axes, then sampling jitter"""
    sd: np.ndarray
    """(n,) standard deviations of θ"""

    def is_outdated(self, theta: np.ndarray, noise: np.ndarray) -> bool:
        """Return True if ``theta`` (n,) or ``noise`` (4,) is too far from that of the flights.

        The mean derivatives ``slope`` and ``curvature`` come from flights that were simulated with
        the parameters and the noise in this object. If the result is True, the mean derivatives
        must be computed again. `REUSED_WITHIN` contains two limits. One is for the change of ln a
        (a: process noise of an axis), the other for the change of a parameter in standard
        deviations.
        """
        noise_range, theta_range = REUSED_WITHIN
        noise_distance = np.abs(np.log(noise[:3] / self.noise[:3])).max()
        theta_distance = np.abs((theta - self.theta) / self.sd).max()
        return bool(noise_distance > noise_range or theta_distance > theta_range)


def optimum_at(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, count: int, converged: bool
) -> Optimum:
    """Return the `Optimum` of a search that ended after ``count`` iterations."""
    low, high = problem.bounds
    point = evaluate(problem, theta, noise, with_noise_derivatives=False)
    loglik = float(point.at.loglik.sum()) + problem.log_prior(theta)
    bound = (theta <= low) | (theta >= high)
    return Optimum(theta, noise, loglik, point.H, point.at, point.T, bound, count, converged)


class AndersonAcceleration:
    """Anderson acceleration of the fixed-point iteration y ← y + f(y), which seeks f(y) = 0.

    It uses the last `DEPTH` steps.
    """

    DEPTH = 2
    MAX_STEP = 6.0  # largest step of an element of y, chosen
    RIDGE = 0.5  # regularisation, chosen

    def __init__(self) -> None:
        self.y: list[np.ndarray] = []
        self.f: list[np.ndarray] = []

    def step(self, y: np.ndarray, f: np.ndarray) -> np.ndarray:
        """Return the step from the iterate ``y`` (k,) to the next iterate, with acceleration.

        ``f`` (k,) is f(y), the step of the iteration without acceleration.
        """
        self.y.append(y)
        self.f.append(f)
        self.y, self.f = self.y[-self.DEPTH - 1 :], self.f[-self.DEPTH - 1 :]
        step = f
        if len(self.f) > 1:
            dF = np.diff(np.array(self.f), axis=0)
            dY = np.diff(np.array(self.y), axis=0)
            gamma = np.linalg.solve(dF @ dF.T + self.RIDGE * np.eye(len(dF)), dF @ f)
            step = f - gamma @ (dF + dY)
        return np.asarray(step * min(1.0, self.MAX_STEP / max(float(np.abs(step).max()), 1e-12)))


def scatter_of(g: np.ndarray, H: np.ndarray) -> np.ndarray:
    """Return C (n, n), a shrinkage estimate of the scores' covariance from few flights.

    ``g`` (B, n): scores of B flights; ``H`` (n, n): the information. C has the correlations of H,
    and the variances r_j H_jj. Let q_j be the variance of score j, divided by H_jj. r_j is halfway
    between q_j and the average of all q, but at least 1 (the value for an exact likelihood).
    """
    ratio = np.sqrt(g.var(axis=0, ddof=1) / np.maximum(np.diag(H), 1e-300))
    ratio = np.maximum(np.sqrt(0.5 * ratio**2 + 0.5 * np.mean(ratio**2)), 1.0)
    return np.asarray(np.outer(ratio, ratio) * H)
