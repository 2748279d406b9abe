"""Whether an estimate's flights are like the recordings: how often the encoders' counts change.

Freed of what the filter gets wrong (`heli3dof.diagnosis.corrected`), an estimate has the scores of
its own flights. Where encoders chatter in the loop, two rigs may have that: the true one, and one
of half the pitch inertia shaken four times as much. They do not fly alike. A loop of less inertia
and an encoder that chatters in it do so faster, so the share of the N samples at which a count
changes tells them apart, and the scores make no use of it:

    r_i = Σ_k [y_i,k+1 ≠ y_i,k] / N,     z_i = (r_i − mean r_ib) / (s_i √(1 + 1/B)),    b = 1 … B

r_ib of flights of the estimate, s_i their standard deviation. Beyond what Student's t with B − 1
is in `FALSELY` of cases, axis i is not alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from heli3dof.diagnosis.corrected import Corrected, fly_again, model_at
from heli3dof.diagnosis.workers import in_threads
from heli3dof.model.filtering import Data
from heli3dof.recording.recording import Recording

FLIGHTS = 24
FALSELY = 0.003
TINY = 1e-12


def edge_rates(data: Data) -> np.ndarray:
    """(3,) the share of samples at which each encoder's count changes, within runs."""
    changed = [np.diff(data.y[start:stop], axis=0) != 0 for _, start, stop in data.blocks]
    return np.asarray(np.concatenate(changed).mean(axis=0))


def rates_apart(found: Corrected, recordings: Sequence[Recording], *, seed: int) -> np.ndarray:
    """(3,) z of the recordings among `FLIGHTS` flights of the estimate."""
    problem, o = found.problem, found.optimum
    model = model_at(problem, o.theta, o.noise)
    flown = in_threads(
        lambda b: edge_rates(fly_again(model, recordings, problem.data, (seed, 17, b))), FLIGHTS
    )
    return against(edge_rates(problem.data), np.array(flown))


def against(seen: np.ndarray, flown: np.ndarray) -> np.ndarray:
    """(n,) z of what is seen (n,) among flights (B, n).

    >>> against(np.array([0.5, 0.2]), np.array([[0.1, 0.2], [0.3, 0.2]])).round(2)
    array([1.73, 0.  ])
    """
    apart = seen - flown.mean(axis=0)
    scatter = flown.std(axis=0, ddof=1) * np.sqrt(1 + 1 / len(flown))
    return np.asarray(apart / np.maximum(scatter, TINY))


def widest(flights: int = FLIGHTS) -> float:
    """Student's quantile, two-sided.

    >>> round(widest(), 2)
    3.3
    """
    from scipy.stats import t

    return float(t.isf(FALSELY / 2, flights - 1))
