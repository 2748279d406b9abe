"""Compute a model's prediction errors from filtered states, and their noise floor.

    e_i = y_i[k + n] − ŷ_i[k + n]       rad, of axis i, n rows ahead

The prediction ŷ starts from the filter's state at row k and uses the recorded voltages. The noise
floor is the error that the true model would have in white noise. If the controller is known, it is
the error on simulated flights of the model. Otherwise it is √(P + Δ²/12), with the filter's
variance P predicted to the horizon and the encoder step Δ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.unmodelled.residual_torque import linearised_run_at
from heli3dof.errors import RecordingError
from heli3dof.identification.bias_correction.simulated_flight import simulated_flight
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.row_selection import usable_runs
from heli3dof.model.control.voltage_replay import controller_is_known
from heli3dof.model.estimation.ekf_quantised import RATE_0
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import NOISE
from heli3dof.model.physics.parametrisation import Structure
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

HORIZONS_S = (0.1, 0.3, 1.0, 3.0)
"""s, horizons of the predictions. Chosen."""
EVERY_S = 0.05
"""s between starts. Chosen."""
SETTLED_S = 0.5
"""s at the start of a run for the filter to settle; no prediction starts there. Chosen."""
FAR = 10 * np.pi
"""rad: a larger or infinite prediction error counts as this value. Chosen: five turns."""


@dataclass(frozen=True, eq=False)
class PredictionErrors:
    """Prediction errors from S starts over H horizons."""

    starts: np.ndarray
    """(S,) rows of the data"""
    horizons_s: tuple[float, ...]
    errors: np.ndarray
    """(S, H, 3) rad, at most `FAR`; NaN beyond the end of a run and on unmeasured axes"""

    def rmse_deg(self) -> np.ndarray:
        """Return the predictions' RMSE (H, 3) in degrees, by horizon and axis."""
        return np.asarray(np.degrees(np.sqrt(mean_square(self.errors))))


def mean_square(e: np.ndarray) -> np.ndarray:
    """Return the mean of the finite e² over the array's first axis; NaN if there are none."""
    finite = np.isfinite(e)
    count = finite.sum(axis=0)
    total = (np.where(finite, e, 0.0) ** 2).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def problem_of(structure: Structure, recordings: Sequence[Recording]) -> Likelihood:
    """Return the likelihood of the recordings' usable runs of rows, for a model ``structure``."""
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    return Likelihood(data_of(recordings, runs), structure)


def noise_of(model: GreyBoxModel) -> np.ndarray:
    """Return (4,): process noise of 3 axes in rad/s²/√Hz, sampling jitter in s.

    The process noise is `NOISE` on axes where the model has none.
    """
    return np.append(np.where(model.noise > 0, model.noise, NOISE), model.jitter_s)


def prediction_errors(
    problem: Likelihood,
    theta: np.ndarray,
    X: np.ndarray,
    horizons_s: Sequence[float],
    starts: np.ndarray | None = None,
) -> PredictionErrors:
    """Return the prediction errors from the filter's states X (N, ≥ 6) at the parameters θ (n,).

    X: columns angles, rates. ``starts`` (S,): rows to start from, by default `starts_of` the data.
    The errors from a start outside the runs are NaN.
    """
    from heli3dof.diagnosis.validation.prediction_passes import predict_free_run

    d, hooks = problem.data, problem.structure.hooks
    s, par = problem.structure.arrays(problem.values(theta))
    starts, rows = starts_of(d) if starts is None else starts, _rows_ahead(d, horizons_s)
    out = np.full((len(starts), len(rows), 3), np.nan)
    inside = np.zeros(len(d.t), dtype=bool)
    for _, start, stop in d.blocks:
        inside[start:stop] = True
    usable = inside[starts]
    readings = out[usable]
    predict_free_run(
        s, hooks.first, hooks.address, par, problem.structure.memory, d.blocks, d.free, d.t, d.h,
        d.V, np.ascontiguousarray(X[:, :6]), starts[usable], rows, readings,
    )  # fmt: skip
    out[usable] = readings
    end = np.minimum(starts[:, None] + rows, len(d.t) - 1)
    return PredictionErrors(starts, tuple(horizons_s), np.clip(d.y[end] - out, -FAR, FAR))


def model_errors(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    horizons_s: Sequence[float] = HORIZONS_S,
) -> tuple[Likelihood, PredictionErrors]:
    """Return the likelihood of the recordings, and the model's prediction errors on them."""
    problem = problem_of(model.structure, recordings)
    theta = problem.scaled(model.values)
    X = problem.run(theta, noise_of(model), keep=2).X
    assert X is not None
    return problem, prediction_errors(problem, theta, X, horizons_s)


def floor_deg(
    model: GreyBoxModel, recordings: Sequence[Recording], *, flights: int = 2, seed: int = 0
) -> tuple[np.ndarray, str]:
    """Return the noise floor (H, 3) in degrees at `HORIZONS_S`, and the name of the method.

    The floor comes from simulated flights. If the controller is unknown, or a simulated flight has
    no usable rows (as with an unstable model), it comes from the filter's covariance.
    """
    by_formula = "the filter's covariance"
    if not controller_is_known(recordings):
        return covariance_floor_deg(model, recordings), by_formula

    def simulated_mean_square(replication: int) -> np.ndarray:
        rng = np.random.default_rng([seed, 77, replication])
        simulated = [simulated_flight(model, r, rng) for r in recordings]
        return mean_square(model_errors(model, simulated)[1].errors)

    try:
        squares = parallel_map(simulated_mean_square, flights)
    except RecordingError:
        return covariance_floor_deg(model, recordings), by_formula
    return np.degrees(np.sqrt(np.mean(squares, axis=0))), f"{flights} flights of the model's own"


def covariance_floor_deg(model: GreyBoxModel, recordings: Sequence[Recording]) -> np.ndarray:
    """Return the noise floor (H, 3) in degrees at `HORIZONS_S`, from the filter's variances."""
    from heli3dof.diagnosis.validation.prediction_passes import prediction_variances

    problem = problem_of(model.structure, recordings)
    noise = noise_of(model)
    flight = linearised_run_at(problem, problem.scaled(model.values), noise)
    d, at = flight.data, flight.at
    starts, rows = starts_of(d), _rows_ahead(d, HORIZONS_S)
    out = np.full((len(starts), len(rows), 3), np.nan)
    P0 = np.zeros((len(d.blocks), 6))
    P0[:, :3] = np.where(d.grid > 0, d.grid**2 / 12, problem.encoder_noise)
    P0[:, 3:] = RATE_0**2
    P0 *= np.hstack([d.free, d.free])
    prediction_variances(
        d.blocks, d.free, d.t, d.h, flight.A, flight.slope, at.row, at.state, at.w, at.K,
        noise[:3] ** 2, P0, starts, rows, out,
    )  # fmt: skip
    rounding = np.where(d.axes, (d.grid**2).max(axis=0) / 12, np.nan)
    finite = np.isfinite(out)
    count = np.maximum(finite.sum(axis=0), 1)
    mean = np.where(finite.any(axis=0), np.where(finite, out, 0.0).sum(axis=0) / count, np.nan)
    return np.asarray(np.degrees(np.sqrt(mean + rounding)))


def with_blocks(data: Data, blocks: np.ndarray) -> Data:
    """Return the data with other ``blocks`` (B, 3), each inside an old block.

    Columns: first row of the lead-in (only its voltages are used), first row of the run, row after
    the run.
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
    """Return the rows (S,) where predictions start: every `EVERY_S`, after `SETTLED_S` in a run."""
    out = [np.zeros(0, dtype=np.int64)]
    for _, start, stop in d.blocks:
        dt = float(np.median(d.h[start:stop]))
        out.append(np.arange(start + round(SETTLED_S / dt), stop, max(1, round(EVERY_S / dt))))
    return np.concatenate(out).astype(np.int64)


def _rows_ahead(d: Data, horizons_s: Sequence[float]) -> np.ndarray:
    dt = float(np.median(d.h))
    return np.array([max(1, round(h / dt)) for h in horizons_s], dtype=np.int64)
