"""Scores of the free-form torques in flights without a residual torque, or in blocks of a flight.

The scores are those of the J hat functions (the torques' shapes) and of the fit's parameters θ. If
the controller is known, the filter computes them on B simulated flights of the fitted rig
(`bias_correction.simulated_flight`). The scores of θ omit the prior's part −Λ(θ − θ_0), so their
mean is the filter's bias ḡ (`bias_correction.correction`). If the controller is unknown, the scores
are computed for half-second blocks of the recorded flight instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.sensitivity.hat_functions import Hats
from heli3dof.diagnosis.sensitivity.residual_torque import LinearisedRun, linearised_run_at
from heli3dof.identification.bias_correction.correction import model_at, simulate_again
from heli3dof.identification.greybox.estimate import BLOCK_S, Estimate, block_numbers
from heli3dof.parallel import replicate
from heli3dof.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores of J hat functions and n parameters in B flights, or in B blocks of a flight."""

    u: np.ndarray
    """(B, J) scores of the hat functions"""
    g: np.ndarray
    """(B, n) scores of the fit's scaled parameters"""


def simulated_scores(
    fit: Estimate, recordings: Sequence[Recording], library: Hats, *, flights: int, seed: int
) -> Scores:
    """Return the scores in simulated flights of the fitted rig; the controller must be known."""
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

    ``tangents`` (p, E): derivatives by the parameters whose scores are returned as ``g`` (B, p).
    """
    which = block_numbers(flight.data, BLOCK_S)
    count = int(which.max()) + 1
    at = which[flight.at.row]
    g = np.column_stack([np.bincount(at, row * flight.at.g, count) for row in tangents])
    return Scores(library.scores(flight, which), g)
