"""Estimate the parameters that differ between recordings: phases and instants.

A periodic torque has the same amplitude and frequency in every recording of a rig, but not the same
phase φ. A mass is added at a different instant t_m in each. In recordings that were not fitted, φ
or t_m is the value that maximises the log-likelihood ℓ there; all other parameters stay as they
are. Several phases and instants are estimated one after another.

For a torque proportional to sin(2π f t + φ), ℓ is nearly a quadratic function of cos φ and sin φ:

    ℓ(φ) = Σ_{k=0..2} a_k cos kφ + b_k sin kφ

`PHASES` values of ℓ determine its coefficients (discrete Fourier transform). The largest ℓ(t_m) is
searched on a grid from before the recording (the mass is there throughout) to after it (never).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from heli3dof.diagnosis.constants import ACCURACY_S
from heli3dof.diagnosis.validation.prediction import with_blocks
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.model.estimation.filter_data import Data
from heli3dof.parallel import parallel_map

PHASES = 8
"""Values of φ at which ℓ is evaluated; five are the fewest for two harmonics."""
INSTANT_S = 1.0
"""s; distance of the grid's instants. The grid begins before the recording and ends after it."""


def rows_of_recordings(d: Data) -> list[tuple[int, int]]:
    """Return the rows [a, b) that hold the runs of each recording, in the order of ``d.runs``."""
    sources = [run.source for run in d.runs]
    of = {s: [b for b, other in zip(d.blocks, sources, strict=True) if other == s] for s in sources}
    return [(int(blocks[0][1]), int(blocks[-1][2])) for blocks in of.values()]


def with_own_values(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, rows: tuple[int, int]
) -> np.ndarray:
    """Return θ (n,) with each phase and instant estimated on the recording in ``rows`` [a, b)."""
    theta = theta.copy()
    d = problem.data
    inside = (d.blocks[:, 1] >= rows[0]) & (d.blocks[:, 2] <= rows[1])
    recording = replace(problem, data=with_blocks(d, d.blocks[inside]))
    by_name = {t.name: t.effect for t in problem.structure.terms}
    for j, f in enumerate(problem.structure.free):
        if f.term is None or not f.per_recording:
            continue

        def loglik(value: float, j: int = j) -> float:
            at = theta.copy()
            at[j] = problem.structure.free[j].scaled(value)
            total = float(recording.run(at, noise, keep=0).loglik.sum())
            return total if np.isfinite(total) else -np.inf

        t = d.t[rows[0] : rows[1]]
        if by_name[f.term].scan == "frequency":
            theta[j] = f.scaled(best_phase(loglik))
        else:
            theta[j] = f.scaled(best_instant(loglik, float(t.min()), float(t.max())))
    return theta


def best_phase(loglik: Callable[[float], float]) -> float:
    """Return the phase in [0, 2π) rad that maximises ``loglik``, a sum of two harmonics.

    >>> round(best_phase(lambda phi: 3 * np.cos(phi - 1.0) - np.cos(phi - 1.0) ** 2), 3)
    1.0
    """
    phases = 2 * np.pi * np.arange(PHASES) / PHASES
    values = parallel_map(lambda k: loglik(float(phases[k])), PHASES)
    if not np.isfinite(values).all():  # the filter diverged at some phases
        return float(phases[np.argmax(values)])
    c = np.fft.rfft(values)[:3] / PHASES
    phi = np.linspace(0.0, 2 * np.pi, 3600, endpoint=False)
    fitted = c[0].real + sum(2 * (c[k] * np.exp(1j * k * phi)).real for k in (1, 2))
    return float(phi[np.argmax(fitted)])


def best_instant(loglik: Callable[[float], float], first: float, last: float) -> float:
    """Return the instant (s) that maximises ``loglik``, searched from before first to after last.

    >>> round(best_instant(lambda t: -abs(t - 7.3), 0.0, 20.0), 1)
    7.3
    """
    from scipy.optimize import minimize_scalar

    grid = np.arange(first - INSTANT_S, last + 2 * INSTANT_S, INSTANT_S)
    values = parallel_map(lambda k: loglik(float(grid[k])), len(grid))
    k = int(np.argmax(values))
    nearest = float(grid[max(k - 1, 0)]), float(grid[min(k + 1, len(grid) - 1)])
    found = minimize_scalar(
        lambda t: -loglik(float(t)), bounds=nearest, method="bounded",
        options={"xatol": ACCURACY_S},
    )  # fmt: skip
    return float(found.x) if -found.fun > values[k] else float(grid[k])
