"""From an optimum to an estimate: values, standard deviations, bounds, correlations, verdicts.

The noise model gives the information H = Σ w ∂c ∂cᵀ. The actual scatter of the scores s follows
from their sums over blocks of half a second, B = Σ_b s_b s_bᵀ. With n parameters and m blocks

    κ = max(1, tr(H⁻¹ B)/n · m/(m − n))      cov = κ (H + Λ)⁻¹

so the intervals hold even where the noise model does not. κ is one number in place of the full
sandwich H⁻¹ B H⁻¹, because with a hundred blocks each entry of B is uncertain by 10 to 20 %, their
average by 2 to 5 %. Values below 1 are not used: blocks of half a second miss the scatter from slow
drifts.

The Cramér–Rao bound is that of the same rig with encoders whose rounding is white noise of variance
Δ²/12, at the estimated process noise (its intensity scaled by √κ).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.identification.greybox.initialisation import likeliest_start
from heli3dof.identification.greybox.likelihood import Likelihood, score_and_information
from heli3dof.identification.greybox.maximum_likelihood import OTHER_ROUNDS, Optimum, maximise
from heli3dof.identification.greybox.physical_fit import PhysicalFit
from heli3dof.model.effects import Term
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.physics.parametrisation import Free, Structure

BLOCK_S = 0.5
TIED = 0.9
"""Parameters with a larger correlation trade off against each other."""
PRIOR_SPEAKS = 0.5
"""A parameter whose σ exceeds this share of its prior's is not identifiable."""
VAGUE_LOG = 0.4
"""A parameter whose logarithm has a larger σ is not identifiable."""


@dataclass(frozen=True)
class Verdict:
    """Whether one parameter can be relied on."""

    identifiable: bool
    absent: bool
    """Within two standard deviations of having no effect."""
    tied_with: tuple[str, ...]
    sentence: str
    """A warning; empty if there is none."""


@dataclass(frozen=True, eq=False)
class Estimate(PhysicalFit):
    """A fitted rig: n parameters in the order of ``structure.free``."""

    problem: Likelihood
    optimum: Optimum

    @property
    def structure(self) -> Structure:
        return self.problem.structure

    @property
    def free(self) -> tuple[Free, ...]:
        return self.structure.free

    @property
    def theta(self) -> np.ndarray:
        """(n,) coordinates"""
        return self.optimum.theta

    @cached_property
    def inflation(self) -> float:
        """κ ≥ 1; 1 where there are too few blocks to estimate it."""
        o, n = self.optimum, len(self.free)
        scores = block_scores(self.problem.data, o, BLOCK_S)
        m = len(scores)
        if m < 2 * n + 2:
            return 1.0
        A = o.information + np.diag(self.problem.prior_precision)
        trace = float(np.trace(np.linalg.solve(A, scores.T @ scores)))
        return max(trace / n * m / (m - n), 1.0)

    @cached_property
    def covariance(self) -> np.ndarray:
        """(n, n) of the values, in their units"""
        A = self.optimum.information + np.diag(self.problem.prior_precision)
        return np.asarray(self.inflation * np.linalg.inv(A) * np.outer(self.slopes, self.slopes))

    @cached_property
    def bound(self) -> np.ndarray:
        """(n,) the Cramér–Rao bound on the standard deviations, in the units of the values."""
        noise = self.optimum.noise * np.array([*[np.sqrt(self.inflation)] * 3, 1.0])
        return np.asarray(cramer_rao(self.problem, self.optimum.theta, noise) * self.slopes)

    def interval(self, z: float = 1.96) -> np.ndarray:
        """(n, 2) confidence intervals; those of logarithms are symmetric in the logarithm."""
        theta, sd = self.optimum.theta, self.std / self.slopes
        return np.column_stack(
            [self.problem.values(theta - z * sd), self.problem.values(theta + z * sd)]
        )

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """One per parameter."""
        prior = 1 / np.sqrt(self.problem.prior_precision)
        sd = self.std / self.slopes
        R = self.correlation
        out = []
        for j, f in enumerate(self.free):
            tied = tuple(
                self.free[i].name
                for i in np.argsort(-np.abs(R[j]))
                if i != j and abs(R[j, i]) > TIED
            )
            vague = sd[j] > PRIOR_SPEAKS * prior[j] or (f.log and sd[j] > VAGUE_LOG)
            absent = (
                f.term is not None and not f.log and abs(self.values[j] - f.null) < 2 * self.std[j]
            )
            out.append(Verdict(not vague, absent, tied, self._sentence(f, vague, tied)))
        return tuple(out)

    def _sentence(self, f: Free, vague: bool, tied: tuple[str, ...]) -> str:
        if not vague:
            return ""
        verdict = f"{f.name} is not identifiable from these recordings"
        if tied:
            verdict += f": it trades off against {', '.join(tied)}"
        owner = next((t for t in self.structure.terms if t.name == f.term), None)
        plan = (owner.effect.separated_by if owner else "") or "multisine"
        return f"{verdict}. The plan {plan!r} gives more information: heli3dof run {plan}"


def estimate(
    problem: Likelihood, *, start: np.ndarray | None = None, noise: np.ndarray | None = None
) -> Estimate:
    """The fit from the nominal rig, or from other starts if that does not converge."""
    if any(t.effect.starts for t in problem.structure.terms):
        start, noise = likeliest_start(
            problem, problem.prior_mean if start is None else start, noise
        )
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


def block_scores(data: Data, optimum: Optimum, block_s: float) -> np.ndarray:
    """(m, n) sums of the scores over blocks of ``block_s``; blocks do not cross runs."""
    o = optimum
    which = np.zeros(len(data.t), dtype=np.int64)
    at = 0
    for _, start, stop in data.blocks:
        elapsed = np.cumsum(data.h[start:stop]) - data.h[start]
        which[start:stop] = at + (elapsed / block_s).astype(np.int64)
        at = int(which[stop - 1]) + 1
    index = which[o.at.row]
    return np.column_stack([np.bincount(index, row * o.at.g, at) for row in o.tangents])


def cramer_rao(problem: Likelihood, theta: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """(n,) the bound on each coordinate's standard deviation, prior included; see the module."""
    white = replace(
        problem,
        data=replace(problem.data, grid=np.zeros_like(problem.data.grid)),
        noise_steps=1 / np.sqrt(12),
    )
    at = white.run(theta, noise)
    _, H = score_and_information(at, white.tangents(theta, at))
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(H + np.diag(problem.prior_precision)))))


@dataclass(frozen=True)
class Candidate:
    """The score test of one more term, and its parameters' values."""

    name: str
    score: float
    """χ² with as many degrees of freedom as the term has parameters: twice the log-likelihood
    gained when all parameters are refitted, to second order."""
    values: tuple[float, ...]
    """The estimate of one Gauss–Newton step, in the parameters' units."""


def score_test(found: Estimate, term: Term) -> Candidate:
    """Rao's score test of one more term: one linearisation, no fit (10 ms per parameter per 60 s).

    The linearisation point is the term's absence. A logarithmic parameter has none, so its start is
    used. The score of a term whose first order vanishes (`motor.saturation`) means little.
    """
    wider = Structure(found.structure.profile, (*found.structure.terms, term))
    problem = replace(found.problem, structure=wider)
    o = found.optimum
    old = len(o.theta)
    theta = np.concatenate(
        [o.theta, [f.inward(f.start if f.log else f.null) for f in wider.free[old:]]]
    )
    new = np.arange(old, len(theta))
    D = np.vstack([o.tangents, problem.tangents(theta, o.at, new)])
    g, H = score_and_information(o.at, D)
    A = H + np.diag(problem.prior_precision)
    g[:old] = 0.0  # they are at their optimum
    inverse = np.linalg.inv(A)[np.ix_(new, new)]
    step = inverse @ g[new]
    score = float(g[new] @ step) / found.inflation
    values = problem.values(np.concatenate([o.theta, theta[new] + step]))[old:]
    return Candidate(term.name, score, tuple(float(v) for v in values))
