"""Compute prediction errors of a model, and estimate parameters that differ between recordings.

    e_i = y_i[k + n] − ŷ_i[k + n]       rad, of axis i, n rows ahead

y is the measured angle. Its prediction ŷ starts from the filter's state at row k and uses the
recorded voltages.

**Phases and instants.** A periodic torque has the same amplitude and frequency in every recording
of a rig, but not the same phase φ. A mass change happens at a different instant t_m in each
recording. For a recording that was not fitted, this module estimates φ and t_m, one after the
other. The estimate is the value at which the log-likelihood ℓ of this recording is largest. All
other parameters keep their values.

For a torque proportional to sin(2π f t + φ), ℓ is nearly a quadratic function of cos φ and sin φ:

    ℓ(φ) = Σ_{k=0..2} a_k cos kφ + b_k sin kφ

`PHASES` values of ℓ determine its coefficients (discrete Fourier transform). The largest ℓ(t_m) is
searched on a grid of instants. The grid starts before the recording (the mass is changed
throughout) and ends after it (the mass is never changed).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from heli3dof.identification.bias_correction.scans import ACCURACY_S
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.effects import term
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import impulse, noise_of
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

HORIZONS_S = (0.1, 0.3, 1.0, 3.0)
"""s, horizons of the predictions. Chosen."""
EVERY_S = 0.05
"""s between starts. Chosen."""
SETTLED_S = 0.5
"""s at the start of an interval of usable rows, in which the filter settles. No prediction starts
there. Chosen."""
MAX_ERROR = 10 * np.pi
"""rad: a larger or infinite prediction error counts as this value. Chosen: five turns."""
PHASES = 8
"""Values of φ at which ℓ is evaluated; five are the fewest for two harmonics."""
INSTANT_S = 1.0
"""s; distance of the grid's instants. The grid begins before the recording and ends after it."""


def mean_square(e: np.ndarray) -> np.ndarray:
    """Return the mean of the finite e² over the array's first axis; NaN if there are none."""
    finite = np.isfinite(e)
    count = finite.sum(axis=0)
    total = (np.where(finite, e, 0.0) ** 2).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def problem_of(structure: Structure, recordings: Sequence[Recording]) -> Likelihood:
    """Return the likelihood function of a model ``structure`` for the recordings.

    It uses only the intervals of usable rows that `usable_runs` returns.
    """
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    return Likelihood(data_of(recordings, runs), structure)


def prediction_errors(
    problem: Likelihood,
    theta: np.ndarray,
    X: np.ndarray,
    horizons_s: Sequence[float],
    starts: np.ndarray,
) -> np.ndarray:
    """Return the errors (S, H, 3) rad of predictions from the S rows ``starts`` over H horizons.

    A prediction starts from the filter's state in X (N, ≥ 6), whose columns are angles and rates.
    The model has the parameters θ (n,). Errors are at most `MAX_ERROR`. An error is NaN on an
    unmeasured axis, and if the prediction does not start and end in the same run (interval of
    usable rows).
    """
    from heli3dof.diagnosis.validation.prediction_passes import predict_free_run

    d, structure = problem.data, problem.structure
    values = problem.values(theta)
    thrust_integral = np.zeros((len(d.t) + 1, 2))
    for lead, start, stop in d.blocks:
        whole = impulse(structure, values, d.V[lead:stop], d.h[lead:stop])
        thrust_integral[start : stop + 1] = whole[start - lead :]
    usable, rows = np.isin(starts, measured_rows(d)), rows_ahead(d, horizons_s)
    out = np.full((len(starts), len(rows), 3), np.nan)
    readings = out[usable]
    predict_free_run(
        *structure.arguments(values), d.blocks, d.free, d.t, d.V, thrust_integral,
        np.ascontiguousarray(X[:, :6]), starts[usable], rows, readings,
    )  # fmt: skip
    out[usable] = readings
    end = np.minimum(starts[:, None] + rows, len(d.t) - 1)
    return np.asarray(np.clip(d.y[end] - out, -MAX_ERROR, MAX_ERROR))


def model_errors(model: GreyBoxModel, recordings: Sequence[Recording]) -> tuple[Data, np.ndarray]:
    """Return the filter's input data from the recordings, and the model's prediction errors.

    The model predicts the angles over the H horizons `HORIZONS_S` from each of S rows. The function
    `starts_of` selects these rows. The errors are (S, H, 3) in rad.
    """
    problem = problem_of(model.structure, recordings)
    theta = problem.structure.scaled(model.values)
    X = problem.run(theta, noise_of(model), keep=2).X
    assert X is not None
    d = problem.data
    return d, prediction_errors(problem, theta, X, HORIZONS_S, starts_of(d))


def with_blocks(data: Data, blocks: np.ndarray) -> Data:
    """Return the data with ``blocks`` (B, 3) in place of its own blocks.

    Each new block lies inside an old one. Columns: first row of the lead-in (only its voltages are
    used), first row of the run, row after the run.
    """
    owner = np.searchsorted(data.blocks[:, 2], blocks[:, 1], side="right")
    return replace(
        data,
        blocks=np.ascontiguousarray(blocks, dtype=np.int64),
        free=data.free[owner],
        grid=data.grid[owner],
        runs=tuple(data.runs[i] for i in owner),
    )


def starts_of(d: Data) -> np.ndarray:
    """Return the rows (S,) from which predictions start: every `EVERY_S` in each run.

    A run is an interval of usable rows. Its first `SETTLED_S` contain no start.
    """
    out = [np.zeros(0, dtype=np.int64)]
    for _, start, stop in d.blocks:
        dt = float(np.median(d.h[start:stop]))
        out.append(np.arange(start + round(SETTLED_S / dt), stop, max(1, round(EVERY_S / dt))))
    return np.concatenate(out).astype(np.int64)


def measured_rows(d: Data) -> np.ndarray:
    """Return the indices of the rows whose readings the filter uses.

    These are all rows inside the runs (intervals of usable rows). The rows before a run that only
    determine the thrusts at its start (lead-in) are omitted.
    """
    return np.concatenate([np.zeros(0, int), *(np.arange(a, b) for _, a, b in d.blocks)])


def rows_ahead(d: Data, horizons_s: Sequence[float]) -> np.ndarray:
    """Return the horizons (H,) in rows of the data."""
    dt = float(np.median(d.h))
    return np.array([max(1, round(h / dt)) for h in horizons_s], dtype=np.int64)


def rows_of_recordings(d: Data) -> list[tuple[int, int]]:
    """Return for each recording the smallest range [a, b) that contains all its usable rows.

    The recordings are in the order of ``d.runs``.
    """
    sources = [run.source for run in d.runs]
    of = {s: [b for b, other in zip(d.blocks, sources, strict=True) if other == s] for s in sources}
    return [(int(blocks[0][1]), int(blocks[-1][2])) for blocks in of.values()]


def with_own_values(
    problem: Likelihood, theta: np.ndarray, noise: np.ndarray, rows: tuple[int, int]
) -> np.ndarray:
    """Return the scaled parameters θ (n,), in part estimated again for a single recording.

    Two parameters differ between recordings: the phase of a periodic torque, and the instant of a
    change of mass. Their new values maximise the likelihood of the recording in ``rows`` [a, b).
    All other parameters keep their values in ``theta``.
    """
    theta = theta.copy()
    d = problem.data
    inside = (d.blocks[:, 1] >= rows[0]) & (d.blocks[:, 2] <= rows[1])
    recording = replace(problem, data=with_blocks(d, d.blocks[inside]))
    for j, f in enumerate(problem.structure.free):
        if f.term is None or not f.per_recording:
            continue

        def loglik(value: float, j: int = j) -> float:
            at = theta.copy()
            at[j] = problem.structure.free[j].scaled(value)
            total = float(recording.loglik(at, noise).sum())
            return total if np.isfinite(total) else -np.inf

        t = d.t[rows[0] : rows[1]]
        if term(f.term).effect.scan == "frequency":
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
    """Return the instant (s) at which ``loglik`` is largest.

    The search covers the interval from ``first`` to ``last`` and a little beyond both ends.

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
