"""Compare models by free-run predictions, for logs without a valid likelihood.

e_k,i(h) is the error (rad) of prediction k on axis i after h seconds. The models predict held-out
recordings. If there are none, the model of each fold, fitted to the other folds, predicts the test
blocks of the fold (cross-validation).

    RMSE_i(h) = √(mean_k e_k,i(h)²),      over 3 s: RMSE_i = √(1/3 ∫₀³ RMSE_i(h)² dh)

A model extension is adopted if Σ_i (RMSE_i,after/RMSE_i,before)² is below the number of axes; both
RMSE are over 3 s. `free_run_gain` computes the decrease of RMSE_i(1 s) and its bootstrap interval.
The bootstrap resamples time intervals of `multistep.WINDOW_S`, because predictions overlap.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.free_run.refits import split_windows
from heli3dof.diagnosis.validation.gain import (
    HORIZON_S,
    Gain,
    HeldOut,
    Predictions,
    gain,
    sums_by_cell,
)
from heli3dof.diagnosis.validation.prediction import MAX_ERROR, mean_square
from heli3dof.identification.greybox.freeflight import flight_of
from heli3dof.identification.greybox.multistep import WINDOW_S
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.model.greybox.prediction import errors, filtered
from heli3dof.recording.recording import Recording

HORIZON_STEP_S = 0.25
"""s: interval of the horizons, the longest of which is `WINDOW_S`"""


@dataclass(frozen=True, eq=False)
class FreeRun:
    """A model's free-run prediction errors, each with the number of its bootstrap block (cell)."""

    e: np.ndarray
    """(S, M, 3) rad: errors of S predictions at M horizons, up to `WINDOW_S`"""
    cell: np.ndarray
    """(S,) number of the cell in which each prediction starts; a cell is `WINDOW_S` long"""

    @classmethod
    def of(cls, model: GreyBoxModel, recordings: Sequence[Recording]) -> FreeRun:
        each, cells, last = [], [], 0
        horizons_s = np.arange(1, round(WINDOW_S / HORIZON_STEP_S) + 1) * HORIZON_STEP_S
        for r in recordings:
            flight = flight_of(r)
            each.append(free_run_errors(model, r, horizons_s))
            cell = np.floor(flight.t[flight.starts] / WINDOW_S).astype(int) + last
            cells.append(cell)
            last = int(cell.max(initial=last)) + 1
        return cls(np.concatenate(each), np.concatenate(cells))

    def window_rmse_deg(self) -> dict[str, float]:
        """Return {axis: RMSE in degrees over all horizons up to `WINDOW_S`}."""
        squares = np.vstack([np.zeros((1, 3)), mean_square(self.e)])
        mean = np.trapezoid(squares, dx=HORIZON_STEP_S, axis=0) / WINDOW_S
        return dict(zip(AXES, np.degrees(np.sqrt(mean)).tolist(), strict=True))


def cross_validated(models: Sequence[GreyBoxModel], recordings: Sequence[Recording]) -> FreeRun:
    """Return the prediction errors of each model on the test windows of its fold.

    ``models``: one model for each fold, fitted to the other folds.
    """
    e, cell = [], []
    flights = [flight_of(r) for r in recordings]
    for fold, model in enumerate(models):
        rows = np.concatenate([split_windows(f, fold)[1] for f in flights])
        run = FreeRun.of(model, recordings)
        e.append(run.e[rows])
        cell.append(run.cell[rows])
    return FreeRun(np.concatenate(e), np.concatenate(cell))


def predicts_better(before: FreeRun, after: FreeRun) -> bool:
    """Return whether ``after`` predicts better than ``before`` over 3 s; all axes weigh equally."""
    b, a = (np.array(list(x.window_rmse_deg().values())) for x in (before, after))
    return bool(np.nansum((a / b) ** 2) < np.isfinite(a / b).sum())


def free_run_errors(
    model: GreyBoxModel, recording: Recording, horizons_s: Iterable[float]
) -> np.ndarray:
    """Return the errors (S, M, 3), in rad, of predictions from S start rows over M horizons.

    Unmeasured axes are NaN.
    """
    flight = flight_of(recording)
    ahead = np.array([max(1, round(h / recording.dt)) for h in horizons_s])
    states = filtered(model, recording)[1]
    with np.errstate(all="ignore"):
        e = errors(model.structure, model.values, flight, states, ahead, tuple(model.varying))
    e = np.clip(np.where(np.isnan(e), MAX_ERROR, e), -MAX_ERROR, MAX_ERROR)
    e[..., ~flight.free] = np.nan
    return np.asarray(e)


def free_run_gain(before: FreeRun, after: FreeRun, on: str, seed: int) -> Gain:
    """Return the decrease of the 1 s prediction RMSE from ``before`` to ``after``, with intervals.

    ``on``: description of the predicted data; ``seed``: random seed of the bootstrap.
    """
    names, cell = np.unique(before.cell, return_inverse=True)
    none = np.zeros(0)

    def held_out(x: FreeRun) -> HeldOut:
        e = x.e[:, round(HORIZON_S / HORIZON_STEP_S) - 1]
        sums = sums_by_cell(e, cell, len(names))
        return HeldOut(none, *sums, none, none, on, Predictions(*[none] * 4))

    return gain(held_out(before), held_out(after), seed=seed)
