"""Find limit cycles on encoder edges, and the process noise with which a rig has them.

A controller with a large derivative gain drives an axis across one encoder edge again and again: a
limit cycle. There the maximum of the filter's likelihood may have a process noise several times too
large and an inertia several times too small. Flights of that rig look different. Of each axis i,
over windows of `WINDOW_S`,

    c_i   share of the windows in which count i changes between two neighbouring values, three
          times or more
    r_i   share of the samples at which count i changes

More noise carries the axis away from its edge, so c falls with the noise intensity a_i
(rad/s²/√Hz). An axis with c > `CYCLES` is on a limit cycle. Its noise is the one with which flights
of the profile's inertias have the recording's c and r:

    a_i = argmin ((c − c̄)/σ_c)² + (ln(r/r̄)/σ_r)²        c̄, r̄: means over simulated flights
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.diagnosis.estimate.bias_correction import model_at, simulate_again
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.estimation.filter_data import Data
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

WINDOW_S = 0.5
CYCLES = 0.2
"""c of an axis on a limit cycle. Rich flights have 0.0 to 0.05, steps of rigs that cycle 0.24 to
0.66; such an axis spends a fifth of its time at one edge."""
FLIGHTS = 2
"""For each noise; a flight costs milliseconds, because nothing is filtered"""
SPREAD = np.array([0.04, 0.05])
"""Standard deviations of c and ln r. c: √(c (1 − c)/n) of the n = 120 windows of a minute, c = 0.3;
r: that of some 400 edges"""
NOISE_STEPS = np.geomspace(1 / 32, 1.0, 11)
"""Multiples of the fitted noise that are simulated; neighbours differ by a factor of √2"""


def edge_rates(data: Data) -> np.ndarray:
    """Return r (3,): the share of samples within runs at which each count changes."""
    changed = [np.diff(data.y[start:stop], axis=0) != 0 for _, start, stop in data.blocks]
    return np.asarray(np.concatenate(changed).mean(axis=0))


def cycling_shares(data: Data) -> np.ndarray:
    """Return c (3,): the share of windows that each axis spends on a limit cycle."""
    shares = []
    for grid, (_, start, stop) in zip(data.grid, data.blocks, strict=True):
        n = max(2, round(WINDOW_S / float(np.median(data.h[start:stop]))))
        windows = (stop - start) // n
        y = data.y[start : start + windows * n].reshape(windows, n, 3)
        narrow = np.ptp(y, axis=1) < 1.5 * grid  # grid 0: an axis without an encoder
        shares.append(narrow & ((np.diff(y, axis=1) != 0).sum(axis=1) >= 3))
    every = np.concatenate(shares)
    return np.asarray(every.mean(axis=0)) if len(every) else np.zeros(3)


def on_limit_cycle(data: Data) -> np.ndarray:
    """Return (3,) bool: the axes on a limit cycle for more than `CYCLES` of the time."""
    return np.asarray(cycling_shares(data) > CYCLES)


def statistics(data: Data) -> np.ndarray:
    """Return (2, 3): c and ln r of each axis."""
    return np.array([cycling_shares(data), np.log(np.maximum(edge_rates(data), 1e-6))])


def matched_noise(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, axes: np.ndarray,
    recordings: Sequence[Recording], *, seed: int,
) -> np.ndarray:  # fmt: skip
    """Return the noise (4,) at which flights at θ (n,) come nearest to the recording's c and r.

    The noise of ``axes`` (3,) bool is replaced by one of `NOISE_STEPS` times ``noise``.
    """
    wanted, best = statistics(problem.data), noise.copy()
    for i in np.flatnonzero(axes):

        def misses(step: float, i: int = int(i)) -> float:
            tried = best.copy()
            tried[i] = noise[i] * step
            model = model_at(problem, theta, tried)

            def flown(b: int) -> np.ndarray:
                return statistics(simulate_again(model, recordings, problem.data, (seed, 23, b)))

            x = np.mean(parallel_map(flown, FLIGHTS), axis=0)
            return float(np.sum(((wanted - x)[:, i] / SPREAD) ** 2))

        best[i] = noise[i] * min(NOISE_STEPS, key=misses)
    return best
