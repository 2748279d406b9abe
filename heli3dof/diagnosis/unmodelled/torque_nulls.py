"""Scores (derivatives of the log-likelihood) by the free-form torques and a fit's parameters.

A free-form torque is a sum of hat functions with coefficients; J functions are tested. If the
controller is known, the filter computes the scores on B simulated flights of the fitted rig, which
contain no residual torque (`bias_correction.simulated_flight`). The scores by the fit's parameters
omit the prior, so their mean is the filter's bias ḡ (`bias_correction.correction`). If the
controller is unknown, the scores are computed for half-second blocks of the recorded flight.
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
    """Scores of the coefficients of J hat (triangular) functions, and of n parameters.

    They are from B simulated flights, or from B blocks of a recorded flight (see the module).
    """

    u: np.ndarray
    """(B, J) scores of the hat functions"""
    g: np.ndarray
    """(B, n) scores of the fit's scaled parameters"""


def simulated_scores(
    fit: Estimate, recordings: Sequence[Recording], library: Hats, *, flights: int, seed: int
) -> Scores:
    """Return the scores in ``flights`` simulated flights of the fitted rig, with its controller."""
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
