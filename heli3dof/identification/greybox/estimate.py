"""Fit by maximum likelihood; compute standard deviations and their Cramér–Rao bounds.

The noise model gives the information matrix H = Σ w ∂c ∂cᵀ, a sum over the readings. ∂c is the
gradient of a predicted reading with respect to the parameters. w is the Fisher information of the
reading. Λ is the prior's precision. Time is divided into m blocks of half a second. s_b is the
score (the gradient of the log-likelihood) of block b. The matrix B = Σ_b s_b s_bᵀ measures the
actual scatter of the scores. The covariance of the parameters is

    cov = κ (H + Λ)⁻¹,      κ = max(1, tr((H + Λ)⁻¹ B)/tr((H + Λ)⁻¹ H) · m/(m − 1))

The factor m/(m − 1) is needed because the scores' sum is zero at the optimum. If the scores scatter
more than the noise model predicts, κ exceeds 1 and widens the confidence intervals. The usual
sandwich covariance H⁻¹ B H⁻¹ is less accurate: with a hundred blocks, each entry of B has an error
of 10 to 20 %. κ averages the entries, which reduces the error to 2 to 5 %. κ is at least 1, because
B ignores the correlation between blocks. Slow drifts cause such a correlation, so B may be too
small.

The Cramér–Rao bound is computed for another noise model. In this model, readings are not rounded to
the encoder step Δ, but contain white noise of variance Δ²/12. The process noise has κ times the
estimated spectral density.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.identification.greybox.likelihood import Likelihood, score_and_information
from heli3dof.identification.greybox.maximum_likelihood import (
    NOISE_START,
    OTHER_ROUNDS,
    Optimum,
    maximise,
    noise_step,
)
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.physics.parametrisation import FreeParameter, Structure

BLOCK_S = 0.5
"""s: length of the blocks over which scores are summed for B"""
LARGE_CORRELATION = 0.9
"""Absolute correlation above which the data do not separate two parameters"""
PRIOR_SHARE_MAX = 0.5
"""A parameter whose σ exceeds this share of its prior's σ is not identifiable."""
LOG_STD_MAX = 0.4
"""σ of a parameter's logarithm above which the parameter is not identifiable"""
SETTLING = 3
"""Number of updates of the noise at each start value, before the likelihoods are compared"""


@dataclass(frozen=True, eq=False)
class Estimate(PhysicalFit):
    """A maximum-likelihood fit of a grey-box model; ``free`` lists its n parameters."""

    problem: Likelihood
    optimum: Optimum

    @property
    def structure(self) -> Structure:
        return self.problem.structure

    @property
    def theta(self) -> np.ndarray:
        return self.optimum.theta

    @cached_property
    def inflation(self) -> float:
        """Return κ: the actual variance of the scores, divided by their expected variance.

        The scores are the gradients of the log-likelihood over blocks of half a second. The noise
        model gives the expected variance. κ is at least 1. For n parameters and fewer than 2 n + 2
        blocks, κ is set to 1.
        """
        o, n = self.optimum, len(self.free)
        scores = block_scores(self.problem.data, o)
        m = len(scores)
        if m < 2 * n + 2:
            return 1.0
        A = o.information + np.diag(self.problem.prior_precision)
        observed, expected = np.linalg.solve(A, [scores.T @ scores, o.information])
        return max(float(np.trace(observed) / np.trace(expected)) * m / (m - 1), 1.0)

    @property
    def score_bias(self) -> np.ndarray:
        """Return the known bias (n,) of the score: zero for a fit without simulated flights."""
        return np.zeros(len(self.theta))

    @property
    def unexplained_scatter(self) -> float:
        """Return the ratio of the scores' actual variance to the expected variance.

        Scores are gradients of the log-likelihood. The noise model gives the expected variance. For
        a bias-corrected fit (`CorrectedFit`), simulated flights give it.
        """
        return self.inflation

    @cached_property
    def covariance(self) -> np.ndarray:
        """Return the covariance (n, n) of the parameters in their units."""
        A = self.optimum.information + np.diag(self.problem.prior_precision)
        return np.asarray(self.inflation * np.linalg.inv(A) * np.outer(self.slopes, self.slopes))

    @cached_property
    def bound(self) -> np.ndarray:
        """Return the Cramér–Rao bound (n,) on the standard deviations, in the parameters' units."""
        noise = self.optimum.noise * np.array([*[np.sqrt(self.inflation)] * 3, 1.0])
        return np.asarray(cramer_rao(self.problem, self.optimum.theta, noise) * self.slopes)

    @cached_property
    def verdicts(self) -> tuple[str, ...]:
        """Return a text per parameter: a warning if the recordings do not identify it, else ""."""
        prior = 1 / np.sqrt(self.problem.prior_precision)
        sd = self.std / self.slopes
        R = self.correlation
        out = []
        for j, f in enumerate(self.free):
            correlated = tuple(
                self.free[i].name
                for i in np.argsort(-np.abs(R[j]))
                if i != j and abs(R[j, i]) > LARGE_CORRELATION
            )
            vague = sd[j] > PRIOR_SHARE_MAX * prior[j] or (f.log and sd[j] > LOG_STD_MAX)
            out.append(self._sentence(f, correlated) if vague else "")
        return tuple(out)

    def _sentence(self, f: FreeParameter, correlated: tuple[str, ...]) -> str:
        verdict = f"{f.name} is not identifiable from these recordings"
        if correlated:
            verdict += f": it trades off against {', '.join(correlated)}"
        owner = next((t for t in self.structure.terms if t.name == f.term), None)
        plan = (owner.effect.separated_by if owner else "") or "multisine"
        return f"{verdict}. The plan {plan!r} gives more information: heli3dof run {plan}"


def estimate(
    problem: Likelihood, *, start: np.ndarray | None = None, noise: np.ndarray | None = None
) -> Estimate:
    """Return the maximum-likelihood fit of the rig's parameters to recordings.

    ``problem`` is the likelihood, a function of n scaled parameters and the noise. ``start`` (n,)
    are the initial parameters of the search. ``noise`` (4,) is the initial noise (None: defaults).
    Its first three elements are the process noise on roll, pitch and yaw (rad/s²/√Hz). The fourth
    is the sampling jitter (s). If the search does not converge, it is repeated from other parameter
    values, and the best result is returned.

    Without ``start``, the search starts at the prior mean. Some effects, such as an added mass,
    begin during a recording. Their onset time is a parameter, for which the prior mean is no good
    initial value. So the model is first fitted without such an effect. A score test then evaluates
    many onset times (`bias_correction.scans`). The initial value is the onset time with the largest
    test statistic.
    """
    if start is None:
        start, noise = _start_at_instants(problem, noise)
    start, noise = _likeliest_start(problem, start, noise)
    best = maximise(problem, start, noise)
    if not best.converged:
        for factor in (0.7, 1.5):
            theta = problem.prior_mean.copy()
            for j, f in enumerate(problem.structure.free):
                theta[j] += np.log(factor) if f.log else 0.0
            other = maximise(problem, theta, noise, rounds=OTHER_ROUNDS)
            if (other.converged, other.loglik) > (best.converged, best.loglik):
                best = other
    return Estimate(problem, best)


def _start_at_instants(
    problem: Likelihood, noise: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return start values of a fit: scaled parameters (n,) and noise (4,).

    Some effects, such as an added mass, begin during a recording. Their onset time is an unknown
    parameter. The function first fits the model without these effects. Then it computes the score
    of each effect for many onset times. The onset time with the largest score is the start value.
    If the model has no such effect, the function returns the prior mean and ``noise``.
    """
    from heli3dof.identification.bias_correction.scans import likeliest_instant

    structure = problem.structure
    changes = [t for t in structure.terms if t.effect.scan == "instant"]
    if not changes:
        return problem.prior_mean, noise
    others = tuple(t for t in structure.terms if t not in changes)
    rest = replace(problem, structure=replace(structure, terms=others))
    base = estimate(rest, noise=noise)
    values = dict(zip(rest.structure.names, base.values, strict=True))
    for t in changes:
        found = likeliest_instant(rest, base.theta, base.optimum.noise, t)
        values |= {f"{t.name}.{p.name}": v for p, v in zip(t.effect.parameters, found, strict=True)}
    return structure.scaled(structure.values_of(values)), base.optimum.noise


def _likeliest_start(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return the scaled parameters (n,) and the noise (4,) from which a fit should start.

    Some effects, such as ``encoder.backlash``, have a likelihood with zero slope at the nominal
    value, and possibly several maxima. Such an effect lists start values of its first parameter in
    ``starts``. The function tries these values and the value in ``theta``, and takes the one with
    the largest likelihood. The other parameters are those in ``theta``. The function also
    re-estimates the noise at these parameters. The first three elements of the noise are the
    process noise on roll, pitch and yaw (rad/s²/√Hz). The fourth is the sampling jitter (s).
    """
    a = np.array(NOISE_START if noise is None else noise, dtype=float)
    theta = theta.copy()
    for term in problem.structure.terms:
        if not term.effect.starts:
            continue
        j = problem.structure.names.index(f"{term.name}.{term.effect.parameters[0].name}")
        best, chosen = -np.inf, theta[j]
        settled = a
        for start in (
            theta[j],
            *(problem.structure.free[j].scaled(v) for v in term.effect.starts),
        ):
            theta[j] = start
            for _ in range(SETTLING):
                a, _ = noise_step(problem, theta, a, problem.data.axes)
            loglik = float(problem.loglik(theta, a).sum()) + problem.log_prior(theta)
            if loglik > best:
                best, chosen, settled = loglik, start, a
        theta[j], a = chosen, settled
    return theta, a


def block_scores(data: Data, optimum: Optimum) -> np.ndarray:
    """Return the gradients (m, n) of the log-likelihood, one for each of m blocks of `BLOCK_S`.

    The gradients are with respect to the n scaled parameters, at ``optimum``.
    """
    o = optimum
    which = block_numbers(data, BLOCK_S)
    index, count = which[o.at.row], int(which.max()) + 1
    return np.column_stack([np.bincount(index, row * o.at.g, count) for row in o.tangents])


def block_numbers(data: Data, block_s: float) -> np.ndarray:
    """Return each row's block number (N,).

    A block lasts ``block_s`` s. Blocks end at gaps between the row ranges of ``data``, so the last
    block before a gap may be shorter.
    """
    which = np.zeros(len(data.t), dtype=np.int64)
    at = 0
    for _, start, stop in data.blocks:
        elapsed = np.cumsum(data.h[start:stop]) - data.h[start]
        which[start:stop] = at + (elapsed / block_s).astype(np.int64)
        at = int(which[stop - 1]) + 1
    return which


def cramer_rao(problem: Likelihood, theta: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Return the Cramér–Rao bound (n,) on the standard deviations of the scaled parameters.

    The bound is evaluated at the scaled parameters ``theta`` (n,). It includes the prior's
    information. The first three elements of ``noise`` (4,) are the process noise on roll, pitch and
    yaw (rad/s²/√Hz). The fourth is the sampling jitter (s).
    """
    white = replace(
        problem,
        data=replace(problem.data, grid=np.zeros_like(problem.data.grid)),
        noise_steps=1 / np.sqrt(12),
    )
    at = white.run(theta, noise)
    _, H = score_and_information(at, white.tangents(theta, at))
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(H + np.diag(problem.prior_precision)))))
