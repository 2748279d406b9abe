"""Detect limit cycles on encoder edges, and estimate the process noise of a rig that has them.

A controller with a large derivative gain drives an axis across one encoder edge (the angle at which
the count changes) again and again: a limit cycle. Then the process noise at the maximum of the
filter's likelihood may be several times too large, and an inertia several times too small. Flights
simulated with such a fit differ from the recording in two statistics of each axis i:

    c_i   share of the windows of `WINDOW_S` with three or more changes of count i, all between two
          neighbouring values
    r_i   share of the samples at which count i changes

More noise carries the axis away from its edge, so c falls as the noise intensity a_i (rad/s²/√Hz)
grows. An axis with c > `CYCLES` is on a limit cycle. Its estimated noise intensity is the one at
which flights simulated with given inertias agree best with the recording's c and r:

    a_i = argmin ((c − c̄)/σ_c)² + (ln(r/r̄)/σ_r)²

c̄ and r̄ are means over `FLIGHTS` flights; σ_c and σ_r are standard deviations (`SPREAD`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.identification.bias_correction.correction import (
    MAX_INFLATION,
    model_at,
    simulate_again,
)
from heli3dof.identification.greybox.estimate import Estimate
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.estimation.filter_data import Data
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

WINDOW_S = 0.5  # chosen
CYCLES = 0.2
"""Threshold of the share c of windows: flights of plan `rich` have up to 0.05, steps on a limit
cycle 0.24 to 0.66."""
FLIGHTS = 2  # simulated flights at each noise intensity
SPREAD = np.array([0.04, 0.05])
"""Standard deviations of c and ln r. c: √(c (1 − c)/n) for c = 0.3 and the n = 120 windows of a
minute. ln r: 1/√400, for 400 edges."""
NOISE_STEPS = np.geomspace(1 / 32, 1.0, 11)
"""Noise intensities that are compared, as multiples of the given one, in steps of √2"""


def edge_rates(data: Data) -> np.ndarray:
    """Return r (3,): the share of samples at which each axis' encoder count changes."""
    changed = [np.diff(data.y[start:stop], axis=0) != 0 for _, start, stop in data.blocks]
    return np.asarray(np.concatenate(changed).mean(axis=0))


def cycling_shares(data: Data) -> np.ndarray:
    """Return c (3,): the share of windows (`WINDOW_S` s) in which each axis is on a limit cycle."""
    shares = []
    for grid, (_, start, stop) in zip(data.grid, data.blocks, strict=True):
        n = max(2, round(WINDOW_S / float(np.median(data.h[start:stop]))))
        windows = (stop - start) // n
        y = data.y[start : start + windows * n].reshape(windows, n, 3)
        narrow = np.ptp(y, axis=1) < 1.5 * grid  # grid 0: an axis without an encoder
        shares.append(narrow & ((np.diff(y, axis=1) != 0).sum(axis=1) >= 3))
    cycling = np.concatenate(shares)
    return np.asarray(cycling.mean(axis=0)) if len(cycling) else np.zeros(3)


def on_limit_cycle(data: Data) -> np.ndarray:
    """Return (3,) bool: the axes on a limit cycle in more than the share `CYCLES` of windows."""
    return np.asarray(cycling_shares(data) > CYCLES)


def scatters_on_limit_cycle(fit: Estimate) -> bool:
    """Return True if an axis is on a limit cycle and the fit's scores vary more than expected.

    The scores are the log-likelihood's gradients. Their actual variance divided by the expected one
    is `Estimate.unexplained_scatter`; it must exceed `MAX_INFLATION`.
    """
    cycling = on_limit_cycle(fit.problem.data).any()
    return bool(cycling) and fit.unexplained_scatter > MAX_INFLATION


def limit_cycle_statistics(data: Data) -> np.ndarray:
    """Return c (row 0) and ln r (row 1) of the three axes, as an array (2, 3).

    c is the share of time windows in which the axis is on a limit cycle (`cycling_shares`), r the
    share of samples at which its encoder count changes (`edge_rates`).
    """
    return np.array([cycling_shares(data), np.log(np.maximum(edge_rates(data), 1e-6))])


def matched_noise(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, axes: np.ndarray,
    recordings: Sequence[Recording], *, seed: int,
) -> np.ndarray:  # fmt: skip
    """Return ``noise`` (4,) with a new estimate of the process noise on each of the ``axes``.

    The first three elements of ``noise`` are the process noise on roll, pitch and yaw
    (rad/s²/√Hz). The fourth is the sampling jitter (s). ``axes`` (3,) bool are the axes on a limit
    cycle. For each of them, the function simulates flights with the axis' process noise times each
    of `NOISE_STEPS`. The estimate is the noise for which the simulated limit cycle is most similar
    to the recorded one (`limit_cycle_statistics`). ``theta`` (n,) are the scaled parameters of the
    simulated model.
    """
    recorded, best = limit_cycle_statistics(problem.data), noise.copy()
    for i in np.flatnonzero(axes):

        def mismatch(step: float, i: int = int(i)) -> float:
            trial = best.copy()
            trial[i] = noise[i] * step
            model = model_at(problem, theta, trial)

            def simulated(b: int) -> np.ndarray:
                return limit_cycle_statistics(
                    simulate_again(model, recordings, problem.data, (seed, 23, b))
                )

            x = np.mean(parallel_map(simulated, FLIGHTS), axis=0)
            return float(np.sum(((recorded - x)[:, i] / SPREAD) ** 2))

        best[i] = noise[i] * min(NOISE_STEPS, key=mismatch)
    return best
