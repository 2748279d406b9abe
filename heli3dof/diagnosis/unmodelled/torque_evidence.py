"""Scores and information of residual torques and of a fit's parameters, from a recorded flight.

A residual torque is a torque that the fitted model lacks. It is a linear combination of functions
with K coefficients (`unmodelled.residual_torque`). The fit has p scaled parameters θ
(`FreeParameter.scaled`), with prior mean θ_0 and prior information Λ. c (E,) are the predicted
encoder readings, and w (E,) is their information. T (p, E) are the derivatives ∂c/∂θ, D (K, E)
those of c with respect to the K coefficients. Then

    A = T w Tᵀ + Λ        g = T ∂ ln L/∂c − Λ(θ − θ_0)      information and score of θ
    V = D w Dᵀ            u = D ∂ ln L/∂c                   information and score of the torques
    X = T w Dᵀ                                              information shared by both

B flights of the fitted rig are simulated, without residual torque. Their scores of θ do not include
the prior, so the mean score is the filter's bias ḡ (`bias_correction.correction`). If flights
cannot be simulated, the scores are computed for half-second blocks of the recorded flight.

**Similarity.** A residual torque and a candidate effect of trial size (`search.score_test`) both
change the predicted readings. cos is the correlation of these two changes, with θ projected out of
both. If |cos| exceeds `LIKE`, the torque is reported as "…-like", with the name of the effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.search.catalogue import candidates, probes
from heli3dof.diagnosis.search.score_test import Screen
from heli3dof.diagnosis.unmodelled.residual_torque import (
    Hats,
    LinearisedRun,
    hats,
    linearised_run,
    linearised_run_at,
)
from heli3dof.identification.bias_correction.coloured_noise import (
    MEMORY_S,
    freedom,
    long_run,
    significant_ratio,
)
from heli3dof.identification.bias_correction.correction import (
    CorrectedFit,
    model_at,
    simulate_again,
)
from heli3dof.identification.bias_correction.evaluation import evaluate
from heli3dof.identification.bias_correction.perturbation import Path, path, project_out
from heli3dof.identification.bias_correction.scans import MIN_INFORMATION_SHARE
from heli3dof.identification.greybox.estimate import BLOCK_S, Estimate, block_numbers
from heli3dof.identification.greybox.likelihood import score_and_information
from heli3dof.model.estimation.ekf_quantised import FilterRun
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording

LIKE = 0.9
"""Least |cos| of a similar torque and cause. Chosen; not derived."""
RANK_TOLERANCE = 1e-4
"""Directions with less than this share of the largest information are dropped. Chosen."""
CONSTANT_MEMORY_S = 1.5
"""s, correlation time allowed for in the score of a constant torque. Chosen; not derived."""


@dataclass(frozen=True, eq=False)
class Nuisance:
    """Nuisance parameters, projected out of every score: those of the fit and of accepted torques.

    Accepted torques are residual torques that the search has already found.
    """

    tangents: np.ndarray
    """(p, E) derivatives of the predicted readings"""
    A: np.ndarray
    g: np.ndarray
    """A: (p, p) information with priors; g: (p,) score"""
    g_null: np.ndarray
    """(B, p) scores in the null simulations"""

    @staticmethod
    def of_fit(fit: CorrectedFit, flight: LinearisedRun) -> Nuisance:
        problem, o = fit.problem, fit.optimum
        # Not the fit's own tangents: without convergence these belong to an earlier point.
        tangents = problem.tangents(o.theta, flight.at)
        g, H = score_and_information(flight.at, tangents)
        prior = problem.prior_precision * (o.theta - problem.prior_mean)
        A = H + np.diag(problem.prior_precision)
        return Nuisance(tangents, A, g - prior, np.zeros((0, len(g))))

    def with_torque(
        self,
        flight: LinearisedRun,
        D: np.ndarray,
        P: np.ndarray,
        columns: np.ndarray,
        null: Scores | None,
    ) -> Nuisance:
        """Return these nuisance parameters, extended by the coefficients of a further torque.

        The torque is a sum of `KNOTS` hat functions times coefficients. ``D`` (KNOTS, E):
        derivatives of the E predicted encoder readings with respect to the coefficients. ``P``
        (KNOTS, rank): linear combinations of the coefficients on which the flight has information.
        Only these combinations are added. ``null``: scores in null simulations, or None without
        such simulations. ``columns`` (KNOTS,): indices of the columns of ``null.u`` with the scores
        of the coefficients.
        """
        D = P.T @ D
        stacked = np.vstack([self.tangents, D])
        shared = (self.tangents * flight.at.w) @ D.T
        information = (D * flight.at.w) @ D.T
        A = np.block([[self.A, shared], [shared.T, information]])
        g = np.concatenate([self.g, D @ flight.at.g])
        g_null = self.g_null
        if null is not None:
            g_null = np.hstack([self.g_null, null.u[:, columns] @ P])
        return Nuisance(stacked, A, g, g_null)


@dataclass(frozen=True, eq=False)
class Evidence:
    """The data of a test for residual torques, that is, for torques that the fitted model lacks.

    ``flight`` is the Kalman filter's run over the recordings, ``library`` a set of torques. The
    scores of these torques are computed from ``flight``. ``null``: the same scores in flights
    simulated without residual torque; None if no flights were simulated.
    """

    fit: CorrectedFit
    flight: LinearisedRun
    library: Hats
    null: Scores | None
    nuisance: Nuisance
    """The fit's parameters only"""

    @cached_property
    def path(self) -> Path:
        """Return the Kalman filter's states, and the model's Jacobians ∂q̈/∂(q, q̇) at these states.

        `perturbation.forward` computes from them how a small torque changes the predicted encoder
        readings.
        """
        problem, o = self.fit.problem, self.fit.optimum
        return path(problem.structure, problem.values(o.theta), problem.data, self.flight.at)


def evidence_without_nulls(fit: CorrectedFit) -> Evidence:
    """Return the data of a test for residual torques, from the recordings of ``fit`` alone.

    A residual torque is a torque that the fitted model lacks. No flights are simulated, so ``null``
    is None in the result.
    """
    flight = linearised_run(fit)
    library = hats(flight, np.flatnonzero(fit.problem.data.axes))
    return Evidence(fit, flight, library, None, Nuisance.of_fit(fit, flight))


def evidence(
    fit: CorrectedFit, recordings: Sequence[Recording], *, flights: int, seed: int
) -> Evidence:
    """Return the data of a test for residual torques in the ``recordings`` of ``fit``.

    A residual torque is a torque that the fitted model lacks. If ``fit`` was bias-corrected by
    simulated flights, the result contains the scores of ``flights`` further simulated flights
    without residual torque (``null``).
    """
    x = evidence_without_nulls(fit)
    if not fit.is_corrected:
        return x
    null = simulated_scores(fit, recordings, x.library, flights=flights, seed=seed)
    return replace(x, null=null, nuisance=replace(x.nuisance, g_null=null.g))


def coloured_noise_ratio(
    flight: LinearisedRun,
    nuisance: Nuisance,
    D: np.ndarray,
    P: np.ndarray,
    torque: np.ndarray,
    white: float,
    chance: float,
) -> float:
    """Return ρ ≥ 1, the factor by which coloured noise increases the variance of a torque's score.

    The torque is linear in K coefficients with the estimate ``torque`` (K,). Its score is the
    derivative of the log-likelihood ln L with respect to the coefficients. ``D`` (K, E) are the
    derivatives ∂c/∂(coefficients) of the E predicted encoder readings c. For k linear combinations
    of the coefficients, a ratio is computed in four steps:

    1. Subtract the effect of the estimated torque from the derivatives ∂ ln L/∂c.
    2. From these, compute the score (k,) of each half-second block of the flight.
    3. S (k, k) is the long-run covariance of the sum of these scores (Newey and West,
       `bias_correction.coloured_noise`). V (k, k) is the Fisher information of the combinations.
    4. The ratio is tr(V⁺ S)/(k ``white``). ``white`` is the value of tr(V⁺ S)/k with white noise.

    A ratio counts as 1 unless it exceeds the 1 − ``chance`` quantile of its distribution with white
    noise. ρ is the larger of two ratios, but at least 1. One ratio is for the columns of ``P``
    (K, k), with the parameters ``nuisance`` projected out of ``D``. The other is for a constant
    torque (k = 1).
    """
    at = flight.at
    which = block_numbers(flight.data, BLOCK_S)[at.row]
    blocks = int(which.max()) + 1
    projected = project_out(D, nuisance.tangents, nuisance.A, at.w)
    remaining = at.g - at.w * (torque @ projected)
    ratio = [1.0]
    for directions, memory_s in (
        (P.T @ projected, MEMORY_S),
        (D.sum(axis=0)[None], CONSTANT_MEMORY_S),
    ):
        scores = np.column_stack(
            [np.bincount(which, row * remaining, blocks) for row in directions]
        )
        memory = round(memory_s / BLOCK_S)
        V = (directions * at.w) @ directions.T
        if blocks >= 2 * (memory + 1):
            S = np.linalg.pinv(V, hermitian=True) @ long_run(scores, memory)
            ratio.append(
                float(
                    significant_ratio(np.trace(S) / len(V) / white, freedom(blocks, memory), chance)
                )
            )
    return max(ratio)


def informative_directions(V: np.ndarray, full: np.ndarray) -> np.ndarray:
    """Return the eigenvectors (KNOTS, rank) of V (KNOTS, KNOTS) with large enough eigenvalues.

    V is the information matrix of `KNOTS` coefficients. ``full`` is V before the fit's parameters
    were projected out. An eigenvalue is large enough if it exceeds `RANK_TOLERANCE` times the
    largest eigenvalue of ``full``.
    """
    values, vectors = np.linalg.eigh(0.5 * (V + V.T))
    return np.asarray(
        vectors[:, values > RANK_TOLERANCE * max(float(np.linalg.eigvalsh(full)[-1]), 1e-300)]
    )


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores: derivatives of the log-likelihood with respect to torque and model parameters.

    A residual torque is a sum of J hat (triangular) functions times coefficients. The fitted model
    has n parameters. The scores are computed for each of B simulated flights, or for each of B time
    blocks of a recorded flight.
    """

    u: np.ndarray
    """(B, J) derivatives with respect to the coefficients of the hat functions"""
    g: np.ndarray
    """(B, n) derivatives with respect to the fit's scaled parameters"""


def simulated_scores(
    fit: Estimate, recordings: Sequence[Recording], library: Hats, *, flights: int, seed: int
) -> Scores:
    """Return the scores of the fit's parameters and of ``library`` in simulated flights.

    ``flights`` flights of the fitted model are simulated, with the recordings' controller.
    ``library``: hat functions, candidates for a residual torque.
    """
    model = model_at(fit.problem, fit.optimum.theta, fit.optimum.noise)

    def one(b: int) -> tuple[np.ndarray, np.ndarray]:
        data = simulate_again(model, recordings, fit.problem.data, (seed, 31, b))
        problem = replace(fit.problem, data=data)
        o = fit.optimum
        flight = linearised_run_at(problem, o.theta, o.noise)
        return library.scores(flight), problem.tangents(o.theta, flight.at) @ flight.at.g

    scores = replicate(one, flights, what="flights")
    return Scores(np.array([u for u, _ in scores]), np.array([g for _, g in scores]))


def scores_in_blocks(flight: LinearisedRun, library: Hats, tangents: np.ndarray) -> Scores:
    """Return the scores of trial torques and of p model parameters in B blocks of the flight.

    A score is a derivative of the log-likelihood. Each block is half a second long. ``library``:
    the trial torques. ``tangents`` (p, E): derivatives of the E predicted readings with respect to
    the p parameters. The result's field ``g`` (B, p) contains the scores of these parameters.
    """
    which = block_numbers(flight.data, BLOCK_S)
    count = int(which.max()) + 1
    at = which[flight.at.row]
    g = np.column_stack([np.bincount(at, row * flight.at.g, count) for row in tangents])
    return Scores(library.scores(flight, which), g)


def named_traces(fit: Estimate) -> tuple[list[str], np.ndarray]:
    """Return names and traces (P, E) of P trial effects: candidate causes that ``fit`` lacks.

    A trace (E,) is the change of the E predicted encoder readings if the effect is added to the
    model, with trial values of its parameters.
    """
    problem, o = fit.problem, fit.optimum
    axes = [a for a, measured in zip(AXES, problem.data.axes, strict=True) if measured]
    fitted = [t.name for t in fit.structure.terms]
    named = [
        p
        for t in candidates(fitted, axes)
        if not t.effect.formal
        for p in probes(t, problem.data.V)
    ]
    evaluation = evaluate(problem, o.theta, o.noise, with_noise_derivatives=False)
    return [p.name for p in named], Screen(problem, o.theta, evaluation, named).D


def similarity(
    named: tuple[list[str], np.ndarray],
    at: FilterRun,
    trace: np.ndarray,
    tangents: np.ndarray,
    A: np.ndarray,
) -> tuple[str, float]:
    """Return (name of the most similar cause, |cos|) for a torque.

    The torque changes the E predicted encoder readings by ``trace`` (E,). cos is the correlation of
    this change with the change that a cause makes. ``named``: the causes, from `named_traces`. p
    nuisance parameters are projected out of both changes. ``tangents`` (p, E) are the derivatives
    of the readings with respect to these parameters. ``A`` (p, p) is the parameters' information
    including the prior.
    """
    names, D = named
    D = np.vstack([trace, D])
    projected = project_out(D, tangents, A, at.w)
    full, remaining = (np.einsum("ij,j,ij->i", D, at.w, x) for x in (D, projected))
    with_trace = projected @ (at.w * trace)
    informative = remaining > MIN_INFORMATION_SHARE * np.maximum(full, 1e-30)
    with np.errstate(invalid="ignore", divide="ignore"):
        cos = np.abs(np.where(informative, with_trace / np.sqrt(remaining[0] * remaining), 0.0))[1:]
    best = int(np.argmax(cos))
    return names[best], float(cos[best])
