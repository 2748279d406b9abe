"""Compute how much coloured noise increases the error of predictions.

The filter assumes white process noise: an angular acceleration n(t) of each axis, with the density
a² (a in rad/s²/√Hz). Draughts and other real torques are correlated over tenths of a second. The
fit then matches only high frequencies, so long predictions are worse than the filter expects. In a
prediction over h, n causes the error

    e(h) = ∫_0^h (h − s) n(s) ds,       Var e(h) = ρ(h) a² h³/3
    ρ(h) = 1 + 2 Σ_{l ≥ 1} w(l Δ/h) Γ_l/Γ_0,        w(x) = 1 − 3x/2 + x³/2  for x < 1, else 0

w is the normalised autocorrelation of the ramp h − s. The correlation of n is estimated from scores
u_b = Σ g δc, each a sum over the readings in one block of Δ = `BLOCK_S`. g is the score of a
reading's prediction, δc its change by a constant acceleration of 1 rad/s². The mean of the u_b,
which a constant torque causes, is subtracted. Γ_l is their autocovariance at lag l. With white
noise the u_b are uncorrelated, and ρ has the standard deviation √(4 Σ w²/m) for m blocks. ρ is set
to 1 unless it exceeds 1 by `SIGNIFICANT` standard deviations.

The formula neglects stiffness and damping within h. The u_b have the correlation of n, because the
filter responds to n faster than h. A slow torque that the model lacks also counts as noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from statistics import NormalDist

import numpy as np

from heli3dof.diagnosis.validation.per_recording_values import rows_of_recordings, with_own_values
from heli3dof.diagnosis.validation.prediction import noise_of, problem_of
from heli3dof.identification.bias_correction.coloured_noise import CHANCE
from heli3dof.identification.bias_correction.perturbation import forward, path
from heli3dof.identification.greybox.estimate import block_numbers
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

BLOCK_S = 0.05
"""s; a tenth of the time over which torques of real rigs are correlated. Chosen."""
SIGNIFICANT = NormalDist().inv_cdf(1 - CHANCE)
"""99 % quantile of the normal distribution"""


def coloured_variance(
    model: GreyBoxModel, recordings: Sequence[Recording], horizons_s: Sequence[float]
) -> np.ndarray:
    """Return the variance (H, 3) rad² that coloured noise adds to predictions at H horizons.

    It is (ρ − 1) a² h³/3 for each horizon h and axis.
    """
    scores = [torque_scores(model, r) for r in recordings]
    h = np.array(horizons_s)
    rho = [[_rho([u[:, i] for u in scores], float(x)) for i in range(3)] for x in h]
    white = noise_of(model)[:3] ** 2 * h[:, None] ** 3 / 3
    return np.asarray((np.array(rho) - 1) * white)


def torque_scores(model: GreyBoxModel, recording: Recording) -> np.ndarray:
    """Return the scores u (m, 3) of a constant acceleration of each axis in m blocks."""
    problem, noise = problem_of(model.structure, [recording]), noise_of(model)
    (rows,) = rows_of_recordings(problem.data)
    theta = with_own_values(problem, problem.scaled(model.values), noise, rows)
    at = problem.run(theta, noise, keep=2)
    p = path(problem.structure, problem.values(theta), problem.data, at)
    unit = np.zeros((3, len(p.chunk), 3))
    unit[range(3), :, range(3)] = 1.0
    block = block_numbers(problem.data, BLOCK_S)[at.row]
    u = np.column_stack([np.bincount(block, d * at.g) for d in forward(p, unit)])
    return np.asarray(u - u.mean(axis=0))


def _rho(series: Sequence[np.ndarray], horizon_s: float) -> float:
    """Return ρ of one axis at one horizon; ``series``: its scores (m,) of each recording.

    >>> rng = np.random.default_rng(0)
    >>> white = rng.standard_normal(40_000)
    >>> _rho([white], 1.0)
    1.0
    >>> slow = np.convolve(white, np.ones(10))  # a mean over 0.5 s: Γ_l/Γ_0 = 1 − l/10
    >>> x = np.arange(1, 10) / 20
    >>> exact = 1 + 2 * ((1 - 1.5 * x + x**3 / 2) * (1 - 2 * x)).sum()
    >>> bool(abs(_rho([slow], 1.0) / exact - 1) < 0.05)
    True
    """
    lags = np.arange(1, max(2, round(horizon_s / BLOCK_S)))
    x = lags * BLOCK_S / horizon_s
    w = np.where(x < 1, 1 - 1.5 * x + x**3 / 2, 0.0)
    power = sum(float(u @ u) for u in series)
    if not power > 0:
        return 1.0
    covariance = [sum(float(u[:-lag] @ u[lag:]) for u in series) for lag in lags]
    rho = 1 + 2 * float(w @ covariance) / power
    std = np.sqrt(4 * float(w @ w) / sum(map(len, series)))
    return rho if rho > 1 + SIGNIFICANT * std else 1.0
