"""Fit physical parameters by minimising the errors of predictions up to 3 s ahead.

The method is for logs with sampling jitter or unmodelled fast motion. Jitter means that a time
stamp differs from the time of its sample. It causes errors of one-step predictions that are
proportional to the angular rate. A fit to one-step predictions would therefore estimate values too
near zero for all parameters that affect the accelerations. In predictions over a second or more,
these errors are negligible.

A Kalman filter (`heli3dof.model.estimation.ekf_jitter`) estimates the states. From S of these
states, the model is simulated without further correction. e_i[k, j] is the prediction error (rad)
of axis i in the simulation that starts in row k, at the j-th of M horizons. The fit minimises

    Q(θ) = (T/τ)/(S M) Σ_k Σ_j Σ_i ρ(e_i[k, j]/s_i[j]) + (θ − θ_0)ᵀ Λ (θ − θ_0),
    ρ(u) = 2 c² (√(1 + (u/c)²) − 1),   c = `ROBUST`

- T (s): flight time
- τ = `WINDOW_S`: length of a simulation. Simulations that do not overlap count as independent;
  their number is T/τ
- s_i[j]: RMS of the errors e_i[k, j] at the start of the present stage (see below)
- θ_0, Λ: mean and precision (inverse covariance) of the prior of the scaled parameters θ

The fit runs in stages, from short horizons to long ones, because long predictions diverge if the
parameters are poor. The search is `heli3dof.identification.greybox.levenberg_marquardt`. The
derivatives ∂e/∂θ include the change of the filter's states with θ.

The effects' parameters, such as friction and drag, have weak priors. The prior of the inertias
follows from geometry: lengths and a few masses determine the *ratios* of the inertias. Their common
factor is uncertain: the fit gives inertias in units of the thrust gain K_f, which differs by a
factor of two between rigs.

A parameter named in ``varying`` has a different value in each recording. The prior of these values
is N(common value, σ²) with σ = ``varying[name]``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.identification.greybox.levenberg_marquardt import LeastSquares, descend
from heli3dof.identification.greybox.maximum_likelihood import noise_step
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.model.estimation.ekf_jitter import filter_jittered
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.greybox.prediction import Flight, errors
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.stage_clock import Progress

STAGES_S = ((0.25, 0.5, 0.75, 1.0), (0.25, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0))
"""s: prediction horizons of the two successive minimisations (stages), short horizons first"""
ROUNDS = 8
"""Largest number of iterations of a stage"""
WINDOW_S = 3.0
"""τ, s: length of a simulation; simulations that do not overlap count as independent"""
ROBUST = 4.0
RATIO_STD, COMMON_STD = 0.04, 0.15
"""Prior standard deviations: `RATIO_STD` of ln(J_pitch/J_roll) and of ln(J_yaw/J_roll),
`COMMON_STD` of ln J_roll. The J are moments of inertia. If roll does not move, the next axis takes
its place."""
DIFFERENCE = 1e-3
"""Step of the finite differences, in the scaled parameters z"""
SETTLED = 0.03
"""Decrease of Q in an iteration below which a stage ends. Chosen; not derived."""
NOISE_START = (0.08, 0.15, 0.06)
"""rad/s²/√Hz: process noise on roll, pitch, yaw with which the fit starts"""
LEAST_NOISE = 1e-4  # rad/s²/√Hz, chosen
NOISE_SETTLED = 0.1  # largest step of the noise's logarithms when their search ends, chosen
JITTERS_S = (0.0, 0.001, 0.002, 0.004)
"""s: standard deviations of sampling jitter that `likeliest_noise` compares"""
PRIOR_SHARE = 0.7
"""A parameter whose σ exceeds this share of its prior's σ is not identifiable. Chosen."""
FAR = 3.0
"""rad: larger or infinite prediction errors are replaced by this value."""


@dataclass(frozen=True, eq=False)
class MultiStep:
    """The least-squares problem of a multi-step fit: flights, their data, and a model structure.

    The unknowns z (dim,) are scaled parameters: logarithms, or values divided by a typical size.
    The first n are common to all flights. The values of the parameters in ``varying`` follow,
    flight by flight. The methods' argument ``noise`` (4,) is the noise of the Kalman filter. Its
    first three elements are the process noise on roll, pitch and yaw (rad/s²/√Hz). The fourth is
    the sampling jitter (s).
    """

    structure: Structure
    flights: tuple[Flight, ...]
    data: tuple[Data, ...]
    """For each flight, the rows that the filter uses"""
    varying: Mapping[str, float] = field(default_factory=dict)
    """Parameter with a value per recording → its standard deviation between recordings."""
    spread: Mapping[str, float] = field(default_factory=dict)
    """Parameter → prior standard deviation in its unit, in place of the effect's default"""
    centre: Mapping[str, float] = field(default_factory=dict)
    """Parameter → prior mean in its unit, in place of the effect's default"""
    least: Mapping[str, float] = field(default_factory=dict)
    """Parameter → lowest value allowed, in place of the effect's default"""

    @property
    def n(self) -> int:
        return len(self.structure.free)

    @cached_property
    def own(self) -> np.ndarray:
        """Return the indices (B,) of the B parameters that vary by recording."""
        return np.array([self.structure.names.index(v) for v in self.varying], dtype=int)

    @property
    def dim(self) -> int:
        return self.n + len(self.own) * len(self.flights)

    @cached_property
    def start(self) -> np.ndarray:
        """Return the optimiser's start point (dim,): the prior mean of the scaled parameters."""
        return self.unknowns(self.structure.scaled(self.structure.values_of(self.centre)))

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        free = self.structure.free
        low = self.structure.scaled(self.least.get(f.name, f.low) for f in free)
        high = self.structure.scaled(f.high for f in free)
        return self.unknowns(low), self.unknowns(high)

    def unknowns(self, theta: np.ndarray) -> np.ndarray:
        """Return the vector z (dim,) of all unknowns, with the same values for every flight.

        z starts with the scaled parameters ``theta`` (n,). Then, for each flight, it repeats the
        elements of ``theta`` that may differ between flights (``varying``).
        """
        return np.concatenate([theta, np.tile(theta[self.own], len(self.flights))])

    @cached_property
    def prior(self) -> np.ndarray:
        """Return the prior's precision Λ (dim, dim), the inverse covariance of the unknowns z."""
        free = self.structure.free
        std = []
        for f in free:
            given = self.spread.get(f.name, f.prior_std)
            mean = self.centre.get(f.name, f.start)
            as_given = f.name not in self.spread and f.log
            std.append(given if as_given else given / f.slope(mean))
        L = np.zeros((self.dim, self.dim))
        L[: self.n, : self.n] = np.diag(1 / np.square(std))
        # Without flights, as in a prior alone, all axes count as moving.
        moves = np.any([f.free for f in self.flights] or [np.ones(3, bool)], axis=0)
        first, *others = (self.structure.names.index(f"J_{AXES[i]}") for i in np.flatnonzero(moves))
        for j in (first, *others):
            L[j, j] = 0.0
        for j in others:
            d = np.zeros(self.dim)
            d[j], d[first] = 1.0, -1.0
            L += np.outer(d, d) / RATIO_STD**2
        L[first, first] += 1 / COMMON_STD**2
        for i in range(len(self.flights)):
            for b, j in enumerate(self.own):
                d = np.zeros(self.dim)
                d[j], d[self.n + i * len(self.own) + b] = 1.0, -1.0
                size = self.varying[free[j].name] / free[j].typical
                L += np.outer(d, d) / size**2
        return L

    def values(self, z: np.ndarray, flight: int | None = None) -> np.ndarray:
        """Return the parameter values (n,) in their units, from the scaled parameters z (dim,).

        A parameter that varies by recording has the value of the flight with index ``flight``, or
        the common value if ``flight`` is None.
        """
        theta = z[: self.n].copy()
        if flight is not None:
            b = len(self.own)
            theta[self.own] = z[self.n + flight * b : self.n + (flight + 1) * b]
        return self.structure.unscaled(theta)

    def states(self, z: np.ndarray, i: int, noise: np.ndarray) -> np.ndarray:
        """Return the filter's estimates (N, 6) of angles (rad) and rates (rad/s) in flight i.

        Rows that the filter does not use are NaN.
        """
        flight = self.flights[i]
        X = np.full((len(flight.t), 6), np.nan)
        found = filter_jittered(self.structure, self.values(z, i), self.data[i], noise)
        rows = self.data[i].recorded_rows
        X[rows[rows >= 0]] = found.states[rows >= 0]
        return X

    def errors(self, z: np.ndarray, noise: np.ndarray, horizons_s: Sequence[float]) -> list[Any]:
        """Return each flight's prediction errors (S, M, 3) rad from S start rows at M horizons."""
        out = []
        for i, flight in enumerate(self.flights):
            ahead = np.array([max(1, round(h / flight.dt)) for h in horizons_s])
            X = self.states(z, i, noise)
            e = errors(self.structure, self.values(z, i), flight, X, ahead)
            e = np.clip(np.nan_to_num(e, nan=FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)
            e[..., ~flight.free] = 0.0  # axes that were not measured
            out.append(e)
        return out

    def loglik(self, z: np.ndarray, noise: np.ndarray) -> np.ndarray:
        """Return the log-likelihood of the recordings, one value for each axis (3,).

        The Kalman filter `ekf_jitter` computes it. z (dim,) are the scaled parameters. The first
        three elements of ``noise`` (4,) are the process noise on roll, pitch and yaw (rad/s²/√Hz).
        The fourth is the sampling jitter (s).
        """
        parts = [
            filter_jittered(self.structure, self.values(z, i), d, noise).loglik
            for i, d in enumerate(self.data)
        ]
        return np.asarray(np.sum(parts, axis=0))


@dataclass(frozen=True, eq=False)
class MultiStepFit(PhysicalFit):
    """The result of a multi-step fit: parameters that minimise the prediction errors."""

    problem: MultiStep
    z: np.ndarray
    noise: np.ndarray
    """(4,) process noise on roll, pitch, yaw in rad/s²/√Hz, and sampling jitter in s"""
    scale: np.ndarray
    """(M, 3) rad: RMS prediction errors by which the residuals are divided, at the M horizons of
    the last stage"""
    cost: float
    tangents: np.ndarray
    """(dim, R) derivatives of the R weighted residuals with respect to the scaled parameters"""
    rounds: int
    converged: bool

    @property
    def structure(self) -> Structure:
        return self.problem.structure

    @property
    def theta(self) -> np.ndarray:
        """Return the estimated scaled parameters (n,), as defined by `MultiStep`.

        For a parameter that varies by recording, this is the mean over the recordings.
        """
        theta = self.z[: self.problem.n].copy()
        if len(self.problem.own):
            theta[self.problem.own] = self._own.mean(axis=0)
        return np.asarray(theta)

    @property
    def _own(self) -> np.ndarray:
        p = self.problem
        return np.asarray(self.z[p.n :].reshape(len(p.flights), len(p.own)))

    @property
    def by_recording(self) -> dict[str, np.ndarray]:
        """Return {name: values (flights,)} of the parameters that vary by recording."""
        free = self.structure.free
        return {
            free[j].name: np.array([free[j].unscaled(c) for c in self._own[:, b]])
            for b, j in enumerate(self.problem.own)
        }

    @property
    def mostly_prior(self) -> np.ndarray:
        """Return (n,) bool: True if the recordings contain little information on the parameter.

        That is, its standard deviation exceeds `PRIOR_SHARE` times that of the prior. For
        parameters that vary by recording, the result is False.
        """
        own = np.isin(np.arange(self.problem.n), self.problem.own)
        return np.asarray((self.std > PRIOR_SHARE * self.prior_std) & ~own)

    @property
    def prior_std(self) -> np.ndarray:
        """Return the prior standard deviations (n,) of the parameters, in their units."""
        n = self.problem.n
        return np.asarray(np.sqrt(np.diag(np.linalg.inv(self.problem.prior))[:n]) * self.slopes)

    @cached_property
    def covariance(self) -> np.ndarray:
        """Return the covariance (n, n) of the parameters in their units."""
        n = self.problem.n
        return np.asarray(self.scaled_covariance[:n, :n] * np.outer(self.slopes, self.slopes))

    @cached_property
    def information(self) -> np.ndarray:
        """Return the information (dim, dim) of the scaled parameters, including the prior's."""
        return np.asarray(self.tangents @ self.tangents.T + self.problem.prior)

    @cached_property
    def scaled_covariance(self) -> np.ndarray:
        """Return the covariance (dim, dim) of the scaled parameters."""
        return np.asarray(np.linalg.inv(self.information))


def robust(u: np.ndarray) -> np.ndarray:
    """Return √ρ(u) (see the module) with the sign of u, for scaled errors u."""
    return np.asarray(np.sign(u) * ROBUST * np.sqrt(2 * (np.sqrt(1 + (u / ROBUST) ** 2) - 1)))


def rms_errors(e: np.ndarray) -> np.ndarray:
    """Return the RMS (M, 3) rad of prediction errors e (S, M, 3) rad: S starts, M horizons, 3 axes.

    Errors above 1 rad count as 1 rad. Errors that are exactly 0, as on axes that were not measured,
    are ignored. The result is at least 0.1° (in rad).
    """
    there = np.maximum((e != 0).sum(axis=0), 1)
    size = np.sqrt((np.minimum(np.abs(e), 1.0) ** 2).sum(axis=0) / there)
    return np.asarray(np.maximum(size, np.radians(0.1)))


def search(
    problem: MultiStep,
    start: np.ndarray | None = None,
    noise: np.ndarray | None = None,
    *,
    stages_s: Sequence[Sequence[float]] = STAGES_S,
    rounds: int = ROUNDS,
    scale: np.ndarray | None = None,
    progress: Progress | None = None,
) -> MultiStepFit:
    """Return the fit that minimises the prediction errors of the flights in ``problem``.

    The search starts at the scaled parameters ``start`` (dim,); None: the prior mean. It minimises
    in stages. ``stages_s`` lists the prediction horizons (s) of each stage. A stage has at most
    ``rounds`` iterations. The residuals are the prediction errors, divided by ``scale`` (M, 3) rad:
    the RMS error of each axis at each of the stage's M horizons. ``noise`` (4,) is the noise of the
    Kalman filter. If ``noise`` or ``scale`` is None, each stage estimates it. ``progress`` gets a
    line of text per iteration.
    """
    p = problem
    z = p.start.copy() if start is None else start.copy()
    a = np.array([*NOISE_START, 0.002]) if noise is None else np.array(noise, dtype=float)
    count = 0
    for stage in stages_s:
        if noise is None:
            a = likeliest_noise(p, z, a)
        s = rms_errors(np.concatenate(p.errors(z, a, stage))) if scale is None else scale

        def report(
            n: int, start_cost: float, here: float, last: float = stage[-1], before: int = count
        ) -> None:
            if progress is not None:
                progress(
                    f"horizon {last:g} s, round {before + n}: cost {start_cost:.0f} → {here:.0f}"
                )

        v = least_squares_problem(p, a, stage, s)
        found = descend(v, z, rounds=rounds, settled=SETTLED, progress=report)
        z, count = found.z, count + found.rounds
    return MultiStepFit(p, z, a, s, found.cost, found.tangents, count, found.settled)


def least_squares_problem(
    p: MultiStep, noise: np.ndarray, stage_s: Sequence[float], scale: np.ndarray
) -> LeastSquares:
    """Return the least-squares problem of one stage: predictions at the M horizons ``stage_s`` (s).

    ``scale`` (M, 3) rad are the RMS errors by which the prediction errors are divided.
    """
    seconds = sum(len(f.starts) * _apart(f) for f in p.flights)
    size = len(stage_s) * sum(len(f.starts) for f in p.flights)
    weight = np.sqrt(seconds / WINDOW_S / size)

    def residuals(at: np.ndarray) -> np.ndarray:
        e = np.concatenate(p.errors(at, noise, stage_s))
        return np.asarray(weight * robust(e / scale).ravel())

    return LeastSquares(residuals, p.start, p.prior, *p.bounds, DIFFERENCE)


def likeliest_noise(p: MultiStep, z: np.ndarray, a: np.ndarray) -> np.ndarray:
    """Return the noise (4,) that maximises the likelihood at the scaled parameters z (dim,).

    The first three elements of the noise are the process noise on roll, pitch and yaw (rad/s²/√Hz).
    The fourth is the sampling jitter (s). The search has two steps:

    1. Compute the likelihood of each jitter in `JITTERS_S`, with the process noise ``a[:3]``. Keep
       the jitter with the largest likelihood.
    2. Improve the process noise, in at most four Newton steps.
    """
    tried = [p.loglik(z, np.append(a[:3], j)).sum() for j in JITTERS_S]
    a = np.append(a[:3], JITTERS_S[int(np.argmax(tried))])
    for _ in range(4):
        a, moved = noise_step(p, z, a, np.ones(3, dtype=bool))
        a[:3] = np.maximum(a[:3], LEAST_NOISE)
        if moved < NOISE_SETTLED:
            break
    return a


def _apart(flight: Flight) -> float:
    """Return the time (s) between the starts of successive simulations of the flight."""
    if len(flight.starts) < 2:
        return WINDOW_S
    return float(np.median(np.diff(flight.t[flight.starts])))
