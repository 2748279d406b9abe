"""What a flight tells of free-form torques beside a fit: their scores, the nulls', what is held.

The fit has p coordinates with tangents T (p, E) ∂c/∂θ in the innovations of E encoder events, each
of information w; a group of free-form torques (`sensitivity.hat_functions`) has traces D. With

    A = T w Tᵀ + Λ,   X = T w Dᵀ,   V = D w Dᵀ,   g = T ∂ ln L/∂c − Λ(θ − θ_0),   u = D ∂ ln L/∂c

Everything that follows is algebra: tests for further torques (`unmodelled_torque`), names with a
residual torque (`stand_ins`), one free form instead of names (`competition`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import CorrectedFit
from heli3dof.diagnosis.estimate.coloured_noise import (
    BLOCK_S,
    MEMORY_S,
    freedom,
    long_run,
    significant_ratio,
)
from heli3dof.diagnosis.estimate.setup import controller_is_known
from heli3dof.diagnosis.sensitivity.hat_functions import Hats, Sums, forward, hats
from heli3dof.diagnosis.sensitivity.residual_torque import Trail, trail
from heli3dof.diagnosis.unmodelled.torque_nulls import Scored, block_numbers, simulated
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import score_and_information
from heli3dof.recording.recording import Recording

RANK = 1e-4
"""Directions with less information than this share of the largest say nothing."""
LEAST_FLIGHTS = 6
BRIEF_S = 1.5


@dataclass(frozen=True, eq=False)
class Held:
    """What is projected out: p directions, the base's coordinates and the leftovers taken."""

    tangents: np.ndarray
    """(p, E)"""
    A: np.ndarray
    """(p, p) their information, priors included"""
    g: np.ndarray
    """(p,) their score"""
    g_null: np.ndarray
    """(B, p) in the nulls"""

    @staticmethod
    def base(found: Estimate, flight: Trail, null: Scored | None) -> Held:
        problem, o = found.problem, found.optimum
        # Of this very pass: where a fit has not settled its own is that of the point before.
        tangents = problem.tangents(o.theta, flight.at)
        g, H = score_and_information(flight.at, tangents)
        pull = problem.prior_precision * (o.theta - problem.prior_mean)
        n = len(g)
        return Held(
            tangents,
            H + np.diag(problem.prior_precision),
            g - pull,
            np.zeros((0, n)) if null is None else null.g,
        )

    def wider(
        self, flight: Trail, D: np.ndarray, P: np.ndarray, columns: np.ndarray, null: Scored | None
    ) -> Held:
        """With one group as well: its traces D (KNOTS, E), in the directions P (KNOTS, rank)."""
        D = P.T @ D
        stacked = np.vstack([self.tangents, D])
        cross = (self.tangents * flight.at.w) @ D.T
        own = (D * flight.at.w) @ D.T
        A = np.block([[self.A, cross], [cross.T, own]])
        g = np.concatenate([self.g, D @ flight.at.g])
        g_null = self.g_null
        if null is not None:
            g_null = np.hstack([self.g_null, null.u[:, columns] @ P])
        return Held(stacked, A, g, g_null)


@dataclass(frozen=True, eq=False)
class Evidence:
    """One fit, its flight, the library for it, and the nulls where the loop is known."""

    found: Estimate
    flight: Trail
    library: Hats
    null: Scored | None
    held: Held
    """Nothing but the fit's own coordinates"""
    sums: Sums
    """Of the library beside these"""


def evidence(
    found: Estimate, recordings: Sequence[Recording], *, flights: int, seed: int
) -> Evidence:
    """Of the recordings that ``found`` was fitted to, and ``flights`` nulls (`LEAST_FLIGHTS`)."""
    flight = trail(found)
    library = hats(flight, np.flatnonzero(found.problem.data.axes))
    null = None
    flies = not isinstance(found, CorrectedFit) or found.scatter is not None
    if flies and controller_is_known(recordings):
        flights = max(flights, LEAST_FLIGHTS)
        null = simulated(found, recordings, library, flights=flights, seed=seed)
    held = Held.base(found, flight, null)
    return Evidence(found, flight, library, null, held, forward(library, flight, held.tangents))


def coloured(
    flight: Trail, held: Held, D: np.ndarray, P: np.ndarray, torque: np.ndarray, white: float
) -> float:
    """ρ (`estimate.coloured_noise`) of what a torque leaves beside it, at least one.

    D (K, E) are its functions' traces, of which the flight tells of the directions P (K, k);
    ``torque`` (K,) is what is taken. With what is ``held`` projected out of D, the scores of the
    events are g − w Dᵀ τ. They are summed in blocks twice: along P, and along a constant torque
    (the functions' sum), over `BRIEF_S`: functions of time take out of what is left all that is
    slower than they are themselves, not what is nearly so slow. What flights of white noise scatter
    of what V says is ``white``.
    """
    at = flight.at
    which = block_numbers(flight.data, BLOCK_S)[at.row]
    blocks = int(which.max()) + 1
    beside = D - np.linalg.solve(held.A, (held.tangents * at.w) @ D.T).T @ held.tangents
    left = at.g - at.w * (torque @ beside)
    ratio = [1.0]
    for along, memory_s in ((P.T @ beside, MEMORY_S), (D.sum(axis=0)[None], BRIEF_S)):
        scores = np.column_stack([np.bincount(which, row * left, blocks) for row in along])
        memory = round(memory_s / BLOCK_S)
        V = (along * at.w) @ along.T
        if blocks >= 2 * (memory + 1):
            S = np.linalg.pinv(V, hermitian=True) @ long_run(scores, memory)
            ratio.append(
                float(significant_ratio(np.trace(S) / len(V) / white, freedom(blocks, memory)))
            )
    return max(ratio)


def told(V: np.ndarray, whole: np.ndarray) -> np.ndarray:
    """(KNOTS, rank): the combinations of the functions that the flight tells of.

    V is what is left of the information ``whole`` once what is held is projected out.
    """
    values, vectors = np.linalg.eigh(0.5 * (V + V.T))
    return np.asarray(vectors[:, values > RANK * max(float(np.linalg.eigvalsh(whole)[-1]), 1e-300)])
