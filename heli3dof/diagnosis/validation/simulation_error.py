"""Compute a model's prediction errors by axis and horizon, their noise floor and worst intervals.

The noise floor is the error that the true model would have (`validation.prediction`), with the
recordings' coloured noise (`validation.coloured_noise`). It should be computed for the model with
the effects found: a fit without these effects attributes them to noise.

The worst interval of an axis is the window of `WINDOW_S` in which predictions over `HORIZON_S` have
the largest mean square error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.validation.coloured_noise import coloured_variance
from heli3dof.diagnosis.validation.gain import HORIZON_S
from heli3dof.diagnosis.validation.prediction import (
    HORIZONS_S,
    PredictionErrors,
    floor_deg,
    mean_square,
    model_errors,
)
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

WINDOW_S = 3.0
"""s, length of the worst interval. Chosen."""


@dataclass(frozen=True)
class WorstInterval:
    """The interval of a recording in which the predictions of one axis have the largest error.

    Times are in s from the recording's first sample.
    """

    axis: str
    recording: str
    start_s: float
    stop_s: float
    rmse_deg: float


@dataclass(frozen=True, eq=False)
class SimulationError:
    """A model's prediction errors over H horizons, by axis, with their noise floor."""

    horizons_s: tuple[float, ...]
    rmse_deg: np.ndarray
    """(H, 3); NaN for an axis that was not measured"""
    floor_deg: np.ndarray
    """(H, 3)"""
    floor_by: str
    """Method that computed the noise floor; empty if the floor is unknown"""
    worst: tuple[WorstInterval, ...]
    """One per measured axis"""

    def at(self, horizon_s: float, axis: str) -> tuple[float, float]:
        """Return (RMSE, noise floor) of an axis in degrees at one of ``horizons_s``."""
        h, i = self.horizons_s.index(horizon_s), AXES.index(axis)
        return float(self.rmse_deg[h, i]), float(self.floor_deg[h, i])


def simulation_error(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    *,
    truth: GreyBoxModel | None = None,
    seed: int = 0,
) -> SimulationError:
    """Return a model's prediction errors on recordings, and their noise floor.

    The noise floor is the error that would remain if ``truth`` (default: ``model``) were the true
    model. Raises RecordingError if no row is usable.
    """
    problem, e = model_errors(model, recordings)
    floor, by = floor_deg(truth or model, recordings, seed=seed)
    coloured = coloured_variance(truth or model, recordings, HORIZONS_S)
    floor = np.sqrt(floor**2 + np.degrees(1.0) ** 2 * coloured)
    worst = _worst(problem.data, e, recordings)
    return SimulationError(HORIZONS_S, e.rmse_deg(), floor, by, worst)


def _worst(
    data: Data, prediction: PredictionErrors, recordings: Sequence[Recording]
) -> tuple[WorstInterval, ...]:
    errors = prediction.errors[:, prediction.horizons_s.index(HORIZON_S)]
    worst: dict[int, WorstInterval] = {}
    for run, (_, start, stop) in zip(data.runs, data.blocks, strict=True):
        inside = (prediction.starts >= start) & (prediction.starts < stop)
        t = data.t[prediction.starts[inside]] + HORIZON_S  # where the prediction is compared
        if not inside.any():
            continue
        last = float(data.t[stop - 1])
        for start_s in np.arange(t[0], max(last - WINDOW_S, t[0]) + 1e-9, WINDOW_S / 3):
            window = (t >= start_s) & (t < start_s + WINDOW_S)
            rmse = np.degrees(np.sqrt(mean_square(errors[inside][window])))
            for i in (i for i in range(3) if np.isfinite(rmse[i])):
                if i not in worst or rmse[i] > worst[i].rmse_deg:
                    worst[i] = WorstInterval(
                        AXES[i], recordings[run.source].name, float(start_s),
                        float(min(start_s + WINDOW_S, last)), float(rmse[i]),
                    )  # fmt: skip
    return tuple(worst[i] for i in sorted(worst))
