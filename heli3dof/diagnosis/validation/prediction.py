"""How far a model is off, some time ahead of states that the filter re-estimated.

    e_i = y_i[k + n] − ŷ_i[k + n | angles to row k, voltages throughout]

from starts `EVERY_S` apart, over each of `HORIZONS_S`. Beside it the noise floor: the same error of
a model where it is the truth. Where the loop is known that is measured, on noisy flights of the
model's own; elsewhere it is the filter's covariance carried ahead, plus a reading's rounding Δ²/12.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.diagnosis.estimate.setup import controller_is_known
from heli3dof.diagnosis.estimate.simulated_flight import simulated_flight
from heli3dof.diagnosis.sensitivity.residual_torque import trail_at
from heli3dof.errors import RecordingError
from heli3dof.identification.greybox.likelihood import Likelihood
from heli3dof.identification.greybox.method import usable_runs
from heli3dof.model.estimation.ekf_quantised import RATE_0
from heli3dof.model.estimation.filter_data import Data, data_of
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import NOISE
from heli3dof.parallel import parallel_map
from heli3dof.recording.recording import Recording

HORIZONS_S = (0.1, 0.3, 1.0, 3.0)
EVERY_S = 0.05
SETTLED_S = 0.5
"""The filter finds its state first."""


@dataclass(frozen=True, eq=False)
class Ahead:
    """S starts, H horizons."""

    starts: np.ndarray
    """(S,) rows of the data"""
    horizons_s: tuple[float, ...]
    errors: np.ndarray
    """(S, H, 3) rad; NaN past a run's end and on axes that were not measured"""

    def rmse_deg(self, of: np.ndarray | None = None) -> np.ndarray:
        """(H, 3), of all starts or those chosen by ``of`` (S,) bool; NaN where there is none."""
        e = self.errors if of is None else self.errors[of]
        return np.asarray(np.degrees(np.sqrt(mean_square(e))))


def mean_square(e: np.ndarray) -> np.ndarray:
    """Over the first axis, what is NaN left out; NaN where nothing is left, ∞ where a prediction
    ran away."""
    there = np.isfinite(e)
    count = there.sum(axis=0)
    with np.errstate(over="ignore"):
        total = (np.where(there, e, 0.0) ** 2).sum(axis=0)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def problem_of(model: GreyBoxModel, recordings: Sequence[Recording]) -> Likelihood:
    """The recordings' usable runs under the model's structure."""
    runs = [run for i, r in enumerate(recordings) for run in usable_runs(r, i)]
    return Likelihood(data_of(recordings, runs), model.structure)


def noise_of(model: GreyBoxModel) -> np.ndarray:
    """(4,) the filter's noise: the model's, or usual values where it knows of none."""
    return np.append(np.where(model.noise > 0, model.noise, NOISE), model.jitter_s)


def ahead(
    problem: Likelihood,
    theta: np.ndarray,
    X: np.ndarray,
    horizons_s: Sequence[float] = HORIZONS_S,
    starts: np.ndarray | None = None,
) -> Ahead:
    """Errors from the filter's states X (N, 6 or more) at θ (n,) coordinates.

    ``starts`` (S,) are rows to start from, those outside the runs giving NaN; `starts_of` the data.
    """
    from heli3dof.diagnosis.validation.prediction_passes import roll_on

    d, hooks = problem.data, problem.structure.hooks
    s, par = problem.structure.arrays(problem.values(theta))
    starts, rows = starts_of(d) if starts is None else starts, _rows(d, horizons_s)
    out = np.full((len(starts), len(rows), 3), np.nan)
    inside = np.zeros(len(d.t), dtype=bool)
    for _, start, stop in d.blocks:
        inside[start:stop] = True
    some = inside[starts]
    part = out[some]
    roll_on(
        s, hooks.first, hooks.address, par, problem.structure.memory, d.blocks, d.free, d.t, d.h,
        d.V, np.ascontiguousarray(X[:, :6]), starts[some], rows, part,
    )  # fmt: skip
    out[some] = part
    end = np.minimum(starts[:, None] + rows, len(d.t) - 1)
    return Ahead(starts, tuple(horizons_s), d.y[end] - out)


def model_ahead(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    horizons_s: Sequence[float] = HORIZONS_S,
) -> tuple[Likelihood, Ahead]:
    """The model's errors on the recordings, and the data they were made on."""
    problem = problem_of(model, recordings)
    theta = problem.coordinates(model.values)
    X = problem.run(theta, noise_of(model), keep=2).X
    assert X is not None
    return problem, ahead(problem, theta, X, horizons_s)


def floor_deg(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    horizons_s: Sequence[float] = HORIZONS_S,
    *,
    flights: int = 2,
    seed: int = 0,
) -> tuple[np.ndarray, str]:
    """((H, 3) degrees, how it was found): the error that is left where the model is the truth.

    The filter's covariance says it where no flight can: the loop is unknown, or the model's own
    flights do not stay in the air (play, and what stood in for a cause, may make it unflyable).
    """
    by_formula = "the filter's covariance"
    if not controller_is_known(recordings):
        return covariance_floor_deg(model, recordings, horizons_s), by_formula

    def one(b: int) -> np.ndarray:
        rng = np.random.default_rng([seed, 77, b])
        flown = [simulated_flight(model, r, rng) for r in recordings]
        return mean_square(model_ahead(model, flown, horizons_s)[1].errors)

    try:
        squares = parallel_map(one, flights)
    except RecordingError:
        return covariance_floor_deg(model, recordings, horizons_s), by_formula
    return np.degrees(np.sqrt(np.mean(squares, axis=0))), f"{flights} flights of the model's own"


def covariance_floor_deg(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    horizons_s: Sequence[float] = HORIZONS_S,
) -> np.ndarray:
    """(H, 3) degrees: the root mean of the variances that the filter itself foresees."""
    from heli3dof.diagnosis.validation.prediction_passes import scatter

    problem = problem_of(model, recordings)
    noise = noise_of(model)
    flight = trail_at(problem, problem.coordinates(model.values), noise)
    d, at = flight.data, flight.at
    starts, rows = starts_of(d), _rows(d, horizons_s)
    out = np.full((len(starts), len(rows), 3), np.nan)
    P0 = np.zeros((len(d.blocks), 6))
    P0[:, :3] = np.where(d.grid > 0, d.grid**2 / 12, problem.encoder_noise)
    P0[:, 3:] = RATE_0**2
    P0 *= np.hstack([d.free, d.free])
    scatter(
        d.blocks, d.free, d.t, d.h, flight.A, flight.slope, at.row, at.state, at.w, at.K,
        noise[:3] ** 2, P0, starts, rows, out,
    )  # fmt: skip
    read = np.where(d.axes, (d.grid**2).max(axis=0) / 12, np.nan)
    there = np.isfinite(out)
    count = np.maximum(there.sum(axis=0), 1)
    mean = np.where(there.any(axis=0), np.where(there, out, 0.0).sum(axis=0) / count, np.nan)
    return np.asarray(np.degrees(np.sqrt(mean + read)))


def of_rows(data: Data, blocks: np.ndarray) -> Data:
    """The same rows in other ``blocks`` (B, 3), each inside one of the old; nothing is copied."""
    owner = np.searchsorted(data.blocks[:, 2], blocks[:, 1], side="right")
    return replace(
        data,
        blocks=np.ascontiguousarray(blocks, dtype=np.int64),
        free=data.free[owner],
        grid=data.grid[owner],
        runs=tuple(data.runs[i] for i in owner),
    )


def starts_of(d: Data) -> np.ndarray:
    """(S,) rows, `EVERY_S` apart, once the filter has settled in each run."""
    out = [np.zeros(0, dtype=np.int64)]
    for _, start, stop in d.blocks:
        dt = float(np.median(d.h[start:stop]))
        out.append(np.arange(start + round(SETTLED_S / dt), stop, max(1, round(EVERY_S / dt))))
    return np.concatenate(out).astype(np.int64)


def _rows(d: Data, horizons_s: Sequence[float]) -> np.ndarray:
    dt = float(np.median(d.h))
    return np.array([max(1, round(h / dt)) for h in horizons_s], dtype=np.int64)
