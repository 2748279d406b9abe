"""Estimates freed of what the filter gets wrong: scores less what flights of the estimate score.

The filter's likelihood is an approximation (Gaussian beliefs; encoders in a feedback loop chatter
on their edges), so its score is not zero on average at the truth and its maximum is biased: on
steps alone the roll inertia by 5 to 10 %, the noise by a factor of two. But what the score is on
average can be seen, because the loop is known: fly the estimate itself, B times, through the same
references, controller and encoders, with its own noise. With g the score of the recordings and
g_b of flight b, all at θ,

    g(θ) − ḡ(θ) − Λ(θ − θ_0) = 0,      ḡ = mean g_b                     (estimating equation)
    θ ← θ + (H + Λ)⁻¹ (g − ḡ − Λ(θ − θ_0))

and likewise, axis by axis, for the slope of the likelihood along the log noise intensities. It is
the method of moments with simulated moments (Gallant and Tauchen 1996; Gouriéroux, Monfort and
Renault 1993), with the filter as the auxiliary model. How far θ scatters follows from how g_b do:

    cov θ = (H + Λ)⁻¹ ((1 + 1/B) C + Λ) (H + Λ)⁻¹,      C = cov g_b

times √ρ_i ρ_j where the recording's own noise is not white (`estimate.coloured_noise`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.diagnosis.estimate.coloured_noise import colour
from heli3dof.diagnosis.estimate.evaluation import evaluate, held
from heli3dof.diagnosis.estimate.simulated_flight import simulated_flight
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import (
    Likelihood,
)
from heli3dof.identification.greybox.maximum_likelihood import (
    NOISE_HIGH,
    NOISE_LOW,
    Optimum,
)
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

PILOTS = 8
"""Flights of each estimate on the way; the same random numbers every time."""
ROUNDS = 10
NEAR = 0.35
"""Standard deviations: a step smaller than this is the last; what `PILOTS` flights leave open."""
NOISE_NEAR = 0.1
UNMOVED = 0.3, 3.0
"""Steps of a log noise intensity, and standard deviations of a parameter: within them the false
slope along the noise is still the one that was seen. It costs two passes a flight to see."""
LOST = 30.0
"""Standard deviations: a step that is still so long after `LOST_AFTER` rounds leads nowhere. A rig
that is fitted without what holds it may be one that its controller cannot fly."""
LOST_AFTER = 3


@dataclass(frozen=True, eq=False)
class ProfileLikelihood(Likelihood):
    """The likelihood where the profile is believed to within its ``tolerance``.

    Inertias differ from nominal by that standard deviation of their logarithm, where `Likelihood`
    allows a factor of two: what a step alone does not tell must not run away.
    """

    doubt: float = 1.0
    """By which the tolerance is multiplied"""

    @cached_property
    def prior_precision(self) -> np.ndarray:
        """(n,) 1/variance in coordinates"""
        free = self.structure.free
        std = np.array([f.prior_std if f.log else f.prior_std / f.typical for f in free])
        std[1:4] = self.doubt * self.structure.profile.tolerance
        return np.asarray(1.0 / std**2)


@dataclass(frozen=True, eq=False)
class CorrectedFit(Estimate):
    """An estimate by the equation above; its scatter is that of simulated flights."""

    scatter: np.ndarray | None = None
    """(n, n) C, the covariance of the scores of the flights; None: the noise model's, × κ, as no
    flights of it are to be had"""
    bias: np.ndarray | None = None
    """(n,) ḡ, the mean of their scores; None: zero"""
    noise_bias: np.ndarray | None = None
    """(3,) s̄, of the slopes along the log noise intensities"""
    flights: int = 0
    spread: np.ndarray | None = None
    """(n, n) the covariance of the coordinates where more moments than scores made the estimate
    (`estimate.edge_rates`)"""

    @cached_property
    def colour(self) -> np.ndarray:
        """(n,) ρ of `estimate.coloured_noise`; ones where there are no flights to compare with"""
        if self.scatter is None:
            return np.ones(len(self.optimum.theta))
        return colour(self, self.scatter)

    @cached_property
    def covariance(self) -> np.ndarray:
        """(n, n) of the values, in their units"""
        if self.scatter is None:
            return np.asarray(Estimate.covariance.func(self))  # type: ignore[attr-defined]
        scale = self.slopes * np.sqrt(self.colour)
        if self.spread is not None:
            return np.asarray(self.spread * np.outer(scale, scale))
        L = np.diag(self.problem.prior_precision)
        inverse = np.linalg.inv(self.optimum.information + L)
        middle = (1 + 1 / self.flights) * self.scatter + L
        return np.asarray(inverse @ middle @ inverse * np.outer(scale, scale))


def model_at(problem: Likelihood, theta: np.ndarray, noise: np.ndarray) -> GreyBoxModel:
    """The rig with these numbers, to fly and to predict with; it knows nothing of their spread."""
    n = len(theta)
    return GreyBoxModel(
        "null", problem.structure.profile, tuple(t.name for t in problem.structure.terms),
        problem.values(theta), noise[:3], np.full((n, n), np.nan), float(noise[3]),
    )  # fmt: skip


def simulate_again(
    model: GreyBoxModel, recordings: Sequence[Recording], data: Data, seed: Sequence[int]
) -> Data:
    """The runs of ``data``, of recordings flown by the model with its own noise."""
    last = [
        max((r.stop for r in data.runs if r.source == i), default=0) for i in range(len(recordings))
    ]
    rng = np.random.default_rng(list(seed))
    flown = [
        simulated_flight(model, r, rng, rows=n) if n else r
        for r, n in zip(recordings, last, strict=True)
    ]
    return data_of(flown, data.runs)


def correct(
    problem: Likelihood,
    theta: np.ndarray,
    noise: np.ndarray,
    recordings: Sequence[Recording],
    *,
    seed: int,
    pilots: int = PILOTS,
    rounds: int = ROUNDS,
    log: Callable[[str], None] = lambda s: None,
) -> CorrectedFit:
    """Solve the estimating equation from near its solution; see the module.

    Where the estimate's own flights do not stay near the recordings', nothing can be learnt from
    them: then ``theta`` and ``noise`` are returned as they came, with no ``scatter`` and no bias.
    """
    begin = theta, noise
    low, high = problem.bounds
    precision = problem.prior_precision
    axes = problem.free_noise
    settled = False
    n = len(theta)
    secant = AndersonAcceleration()
    slopes: FalseSlopes | None = None
    for count in range(1, rounds + 1):
        here = evaluate(problem, theta, noise)
        model = model_at(problem, theta, noise)
        anew = slopes is None or slopes.moved(theta, noise)
        flown = parallel_map(
            lambda b, m=model, th=theta, a=noise, w=anew: evaluate(  # type: ignore[misc]
                replace(problem, data=simulate_again(m, recordings, problem.data, (seed, 7, b))),
                th, a, whole=w,
            ),
            pilots,
            what=f"flights, round {count}",
        )  # fmt: skip
        g = (
            here.g
            - np.mean([f.g for f in flown], axis=0)
            - precision * (theta - problem.prior_mean)
        )
        H = 0.5 * (here.H + np.mean([f.H for f in flown], axis=0))
        A = H + np.diag(precision)
        step = np.zeros(n)
        go = ~held(problem)
        step[go] = np.linalg.solve(A[np.ix_(go, go)], g[go])
        sd = np.sqrt(np.diag(np.linalg.inv(A)))
        if anew:
            slopes = FalseSlopes(
                np.mean([f.slope for f in flown], axis=0),
                np.mean([f.bend for f in flown], axis=0), theta, noise, sd,
            )  # fmt: skip
        assert slopes is not None
        slope = here.slope - slopes.slope
        bend = np.minimum(np.minimum(here.bend, slopes.bend), -1.0)
        move = np.where(axes, np.clip(-slope / bend, -0.7, 0.7), 0.0)
        log(f"{count} {problem.values(theta)} {noise[:3]} step {step / sd} move {move}")
        length = float(np.abs(step / sd).max())
        if not np.isfinite(length) or (count >= LOST_AFTER and length > LOST):
            return CorrectedFit(problem, optimum_at(problem, *begin, count, settled))
        if length < NEAR and np.abs(move).max() < NOISE_NEAR:
            # The last step is taken too: where all start from one side, stopping short is a bias.
            theta = np.clip(theta + step, low, high)
            noise = noise.copy()
            noise[:3] = np.clip(noise[:3] * np.exp(move), NOISE_LOW, NOISE_HIGH)
            settled = True
            break
        if count == 1:
            scale = np.concatenate([sd, np.full(3, NOISE_NEAR / NEAR)])
        move_on = secant.next(
            np.concatenate([theta, np.log(noise[:3])]) / scale, np.concatenate([step, move]) / scale
        )
        move_on = move_on * scale
        theta = np.clip(theta + move_on[:n], low, high)
        noise = noise.copy()
        noise[:3] = np.clip(
            noise[:3] * np.exp(np.clip(move_on[n:], -1.0, 1.0)), NOISE_LOW, NOISE_HIGH
        )
    optimum = optimum_at(problem, theta, noise, count, settled)
    scores = np.array([f.g for f in flown])
    C = scatter_of(scores, optimum.information)
    assert slopes is not None
    return CorrectedFit(problem, optimum, C, scores.mean(axis=0), slopes.slope, pilots)


@dataclass(frozen=True, eq=False)
class FalseSlopes:
    """Along the log noise intensities, as flights of one estimate have them."""

    slope: np.ndarray
    bend: np.ndarray
    """(3,) means over the flights"""
    theta: np.ndarray
    noise: np.ndarray
    """Where they were seen"""
    sd: np.ndarray
    """(n,) standard deviations there"""

    def moved(self, theta: np.ndarray, noise: np.ndarray) -> bool:
        """Whether the estimate is too far from there by now."""
        steps = np.abs(np.log(noise[:3] / self.noise[:3])).max()
        return bool(steps > UNMOVED[0] or np.abs((theta - self.theta) / self.sd).max() > UNMOVED[1])


def optimum_at(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, count: int, settled: bool
) -> Optimum:
    low, high = problem.bounds
    here = evaluate(problem, theta, noise, whole=False)
    loglik = float(here.at.loglik.sum()) + problem.log_prior(theta)
    bound = (theta <= low) | (theta >= high)
    return Optimum(theta, noise, loglik, here.H, here.at, here.T, bound, count, settled)


class AndersonAcceleration:
    """Anderson's acceleration of y ← y + f(y) over the last `DEPTH` steps, which must be short."""

    DEPTH = 2
    LONGEST = 6.0
    RIDGE = 0.5

    def __init__(self) -> None:
        self.y: list[np.ndarray] = []
        self.f: list[np.ndarray] = []

    def next(self, y: np.ndarray, f: np.ndarray) -> np.ndarray:
        """The step to take at y where the plain one is f."""
        self.y.append(y)
        self.f.append(f)
        self.y, self.f = self.y[-self.DEPTH - 1 :], self.f[-self.DEPTH - 1 :]
        go = f
        if len(self.f) > 1:
            dF = np.diff(np.array(self.f), axis=0)
            dY = np.diff(np.array(self.y), axis=0)
            gamma = np.linalg.solve(dF @ dF.T + self.RIDGE * np.eye(len(dF)), dF @ f)
            go = f - gamma @ (dF + dY)
        return np.asarray(go * min(1.0, self.LONGEST / max(float(np.abs(go).max()), 1e-12)))


def scatter_of(g: np.ndarray, H: np.ndarray) -> np.ndarray:
    """(n, n) from few flights: the information's correlations with the flights' own sizes."""
    size = np.sqrt(g.var(axis=0, ddof=1) / np.maximum(np.diag(H), 1e-300))
    # Few flights say little of each: half way to what they say of all.
    size = np.maximum(np.sqrt(0.5 * size**2 + 0.5 * np.mean(size**2)), 1.0)  # exact ones: 1
    return np.asarray(np.outer(size, size) * H)
