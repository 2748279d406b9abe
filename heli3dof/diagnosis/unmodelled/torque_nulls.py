"""What the free-form torques' scores are like where nothing is left.

Simulated nulls: B flights of the fitted rig (`estimate.simulated_flight`), each through the
same filter; their scores of the J functions and of the base. Each costs a flight, one filter pass
and one pass backward. Where the loop is unknown the scatter of the flight's own scores, block of
half a second by block, stands in for them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import model_at, simulate_again
from heli3dof.diagnosis.sensitivity.hat_functions import Hats
from heli3dof.diagnosis.sensitivity.residual_torque import Trail, trail_at
from heli3dof.identification.greybox.estimate import BLOCK_S, Estimate
from heli3dof.model.estimation.filter_data import Data
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording


@dataclass(frozen=True, eq=False)
class Scored:
    """B flights, or m blocks of one: scores of the J functions and of the n base coordinates."""

    u: np.ndarray
    """(B, J)"""
    g: np.ndarray
    """(B, n)"""


def simulated(
    found: Estimate, recordings: Sequence[Recording], library: Hats, *, flights: int, seed: int
) -> Scored:
    """Flights of the fitted rig where the recordings' loop is known."""
    model = model_at(found.problem, found.optimum.theta, found.optimum.noise)

    def one(b: int) -> tuple[np.ndarray, np.ndarray]:
        data = simulate_again(model, recordings, found.problem.data, (seed, 31, b))
        problem = replace(found.problem, data=data)
        o = found.optimum
        flight = trail_at(problem, o.theta, o.noise)
        g = problem.tangents(o.theta, flight.at) @ flight.at.g
        return library.scores(flight), g - problem.prior_precision * (o.theta - problem.prior_mean)

    both = parallel_map(one, flights, what="flights")
    return Scored(np.array([u for u, _ in both]), np.array([g for _, g in both]))


def blockwise(found: Estimate, flight: Trail, library: Hats, tangents: np.ndarray) -> Scored:
    """Half-second blocks of the flight itself; ``tangents`` (p, E) in place of the base's."""
    which = block_numbers(flight.data)
    count = int(which.max()) + 1
    at = which[flight.at.row]
    g = np.column_stack([np.bincount(at, row * flight.at.g, count) for row in tangents])
    return Scored(library.scores(flight, which), g)


def block_numbers(data: Data, block_s: float = BLOCK_S) -> np.ndarray:
    """(N,) the block of each row; blocks do not cross runs."""
    which = np.zeros(len(data.t), dtype=np.int64)
    at = 0
    for _, start, stop in data.blocks:
        elapsed = np.cumsum(data.h[start:stop]) - data.h[start]
        which[start:stop] = at + (elapsed / block_s).astype(np.int64)
        at = int(which[stop - 1]) + 1
    return which
