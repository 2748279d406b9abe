"""Scores and information of free-form torques and of a fit's parameters, from a recorded flight.

A fit has p scaled parameters θ (`FreeParameter.scaled`), with prior mean θ_0 and information Λ.
T (p, E) are the derivatives ∂c/∂θ of the E predicted readings c; w (E,) is the readings'
information. D (K, E) are the derivatives by K coefficients of free-form torques
(`unmodelled.residual_torque`). Then

    A = T w Tᵀ + Λ        g = T ∂ ln L/∂c − Λ(θ − θ_0)      information and score of θ
    V = D w Dᵀ            u = D ∂ ln L/∂c                   information and score of the torques
    X = T w Dᵀ                                              information shared by both

B flights of the fitted rig are simulated, without residual torque. Their scores of θ do not include
the prior, so the mean score is the filter's bias ḡ (`bias_correction.correction`). If flights
cannot be simulated, the scores are computed for half-second blocks of the recorded flight.

**Similarity.** cos is the correlation of two changes of the predicted readings: by a torque, and by
a probe of a candidate effect (`search.score_test`). θ is projected out of both. If |cos| exceeds
`LIKE`, the torque is reported as "…-like", with the name of the effect.
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
    """Parameters projected out of every score: those of the fit and of accepted torques."""

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
        """Return these parameters, extended by the coefficients of a torque's hat functions.

        ``D`` (KNOTS, E): derivatives of the E predictions by the coefficients. ``P`` (KNOTS, rank):
        combinations of coefficients on which the flight has information; only these are added.
        ``columns`` (KNOTS,): the coefficients' columns in ``null.u``.
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
    """A fit's filter run, from which the scores of the residual torques in ``library`` follow.

    ``null``: these scores in flights simulated without such torques; None if no flights were
    simulated.
    """

    fit: CorrectedFit
    flight: LinearisedRun
    library: Hats
    null: Scores | None
    nuisance: Nuisance
    """The fit's parameters only"""

    @cached_property
    def path(self) -> Path:
        """Return the filter's states and derivatives, which give a torque's effect on readings."""
        problem, o = self.fit.problem, self.fit.optimum
        return path(problem.structure, problem.values(o.theta), problem.data, self.flight.at)


def evidence_without_nulls(fit: CorrectedFit) -> Evidence:
    """Return the evidence for torques in the fitted recordings, without simulated flights."""
    flight = linearised_run(fit)
    library = hats(flight, np.flatnonzero(fit.problem.data.axes))
    return Evidence(fit, flight, library, None, Nuisance.of_fit(fit, flight))


def evidence(
    fit: CorrectedFit, recordings: Sequence[Recording], *, flights: int, seed: int
) -> Evidence:
    """Return the evidence for residual torques in the recordings that ``fit`` was fitted to.

    It includes ``flights`` null simulations if ``fit`` was bias-corrected by simulated flights.
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
    """Return ρ ≥ 1, the ratio of the variance of a torque's scores to that with white noise.

    The torque has K coefficients, estimated as ``torque`` (K,). ``D`` (K, E) are the derivatives of
    the E predicted readings by these coefficients. First, the torque's effect is subtracted from
    the readings' scores. Then the scores of k linear combinations of the coefficients are summed
    over blocks of time. V is the information of these sums, S their long-run covariance
    (`bias_correction.coloured_noise`).

    ρ is the largest of 1 and two ratios tr(V⁺ S)/(k ``white``). The first ratio is for the
    combinations ``P`` (K, k), the second for a constant torque (k = 1). ``white`` is the value of
    tr(V⁺ S)/k with white noise. A ratio is ignored if white noise exceeds it with a probability
    above ``chance``. ``nuisance``: parameters projected out.
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

    These exceed `RANK_TOLERANCE` times the largest eigenvalue of ``full``, which is V before the
    fit's parameters are projected out.
    """
    values, vectors = np.linalg.eigh(0.5 * (V + V.T))
    return np.asarray(
        vectors[:, values > RANK_TOLERANCE * max(float(np.linalg.eigvalsh(full)[-1]), 1e-300)]
    )


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of the coefficients of J hat (triangular) functions, and of a fit's n parameters.

    There is one set of scores for each of B simulated flights, or B blocks of a recorded flight.
    """

    u: np.ndarray
    """(B, J) scores of the hat functions"""
    g: np.ndarray
    """(B, n) scores of the fit's scaled parameters"""


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
    """Return the scores in half-second blocks of the flight.

    ``tangents`` (p, E): derivatives of the E predicted readings by p parameters, whose scores are
    returned as ``g`` (B, p), a row for each block.
    """
    which = block_numbers(flight.data, BLOCK_S)
    count = int(which.max()) + 1
    at = which[flight.at.row]
    g = np.column_stack([np.bincount(at, row * flight.at.g, count) for row in tangents])
    return Scores(library.scores(flight, which), g)


def named_traces(fit: Estimate) -> tuple[list[str], np.ndarray]:
    """Return names and traces (P, E) of P trial effects: candidate causes that ``fit`` lacks.

    A trace is the change of the E predicted readings by the effect, at trial values of its
    parameters.
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
    """Return (most similar cause, |cos|) of a torque that changes predictions by ``trace`` (E,).

    cos is the correlation of the changes by torque and cause. ``named``: the causes, from
    `named_traces`. p parameters are projected out: ``tangents`` (p, E) are the derivatives of the
    predictions by these parameters, ``A`` (p, p) is their information including the prior.
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
