"""Compute multi-step prediction errors of models: the angle at row k is predicted h seconds ahead.

    e_h[k] = y[k] − ŷ[k | angles until h seconds earlier, voltages],    RMSE_h = √(mean e_h²)

y are the measured angles, ŷ the predicted angles. Predictions need no controller. The RMSE is given
for three horizons h, and *over* a window of 3 s: the root of the mean square error over all
horizons from 0 to 3 s. The baseline is constant angles: ŷ[k] is the angle measured h seconds
earlier. A useful model has a smaller error than this baseline.

A prediction counts only if all its rows, from the start to row k, are in flight. The models do not
apply on the table, in the climb after take-off, or at a stop. A diagnosis omits such rows too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.arrays import BoolArray, FloatArray
from heli3dof.model.base import Model
from heli3dof.recording.recording import Recording

HORIZONS_S = (0.5, 1.0, 3.0)
CONSTANT_ANGLES = "constant angles"
"""Name of the baseline predictor among the models"""
STEPS_DRAWN = 30
"""Number of horizons in a prediction window whose curve is drawn: every 0.1 s of 3 s"""
STEPS_AVERAGED = 12
"""Number of horizons in a prediction window whose error is only averaged: every 0.25 s of 3 s"""


@dataclass(frozen=True, eq=False)
class Predictions:
    """A model's predictions of the angles in one recording, at several horizons.

    A prediction window consists of the predictions from one row, at all horizons ``instants_s``.
    """

    ahead: Mapping[float, FloatArray]
    """Horizon h in s → (N, 3) rad: each row's angles, predicted h earlier; NaN: not predicted"""
    instants_s: FloatArray
    """(M,) s: the horizons of a prediction window, ascending and evenly spaced"""

    @property
    def window_s(self) -> float:
        """Return the length of a prediction window in s: the longest horizon."""
        return float(self.instants_s[-1])


class ConstantAngles:
    """The baseline predictor: every angle stays at its last measured value."""

    def predict(self, recording: Recording, horizon_s: float) -> FloatArray:
        """Return, for each row, the angles measured ``horizon_s`` s earlier, (N, 3) in rad.

        The rows of the first ``horizon_s`` s are NaN.
        """
        h = max(1, round(horizon_s / recording.dt))
        held = np.full_like(recording.angle, np.nan)
        held[h:] = recording.angle[:-h]
        return held


def predictions(
    model: Model | ConstantAngles,
    recording: Recording,
    horizons_s: Sequence[float] = HORIZONS_S,
    *,
    steps: int = STEPS_DRAWN,
) -> Predictions:
    """Return a model's predictions at ``horizons_s`` (s) and at ``steps`` evenly spaced horizons.

    The last of the evenly spaced horizons is the longest of ``horizons_s``.
    """
    instants = np.round(max(horizons_s) * np.arange(1, steps + 1) / steps, 9)
    wanted = sorted({round(float(h), 9) for h in (*horizons_s, *instants)})
    return Predictions({h: model.predict(recording, h) for h in wanted}, instants)


def common_rows(several: Sequence[Predictions]) -> Mapping[float, BoolArray]:
    """Return the samples that all models predict: horizon (s) → (N, 3) bool, by axis.

    On each axis, models without any prediction of that axis are ignored.
    """
    rows: dict[float, BoolArray] = {}
    for h in several[0].ahead if several else ():
        there = [np.isfinite(p.ahead[h]) for p in several]
        rows[h] = np.logical_and.reduce([ok | ~ok.any(axis=0) for ok in there])
    return rows


def rows_within(part: BoolArray, n: int) -> BoolArray:
    """Return (N,) bool: the rows k for which all rows from k − n to k are in ``part`` (N,) bool."""
    out = np.zeros(len(part), dtype=bool)
    outside = np.concatenate([[0], np.cumsum(~part)])
    if n < len(part):
        out[n:] = outside[n + 1 :] == outside[: len(part) - n]
    return out


def rmse_deg(
    recording: Recording, made: Predictions, rows: Mapping[float, BoolArray] | None = None
) -> Mapping[float, FloatArray]:
    """Return horizon (s) → RMSE (3,) in degrees of the predictions ``made``.

    ``rows``: horizon → (N, 3) bool, the samples to use; None: all that are predicted.
    """
    return {
        h: _rms(np.degrees(y - recording.angle), None if rows is None else rows[h])
        for h, y in made.ahead.items()
    }


def over_window_deg(by_horizon: Mapping[float, FloatArray], made: Predictions) -> FloatArray:
    """Return the RMSE (3,) in degrees over a prediction window, from horizon 0 to the longest.

    ``by_horizon`` is what `rmse_deg` returns for the predictions ``made``. The squares are averaged
    by the trapezoidal rule.
    """
    squares = np.array([by_horizon[float(h)] ** 2 for h in made.instants_s])
    squares = np.vstack([np.zeros((1, squares.shape[1])), squares])
    instants = np.concatenate([[0.0], made.instants_s])
    return np.asarray(np.sqrt(np.trapezoid(squares, instants, axis=0) / made.window_s))


def stitched(recording: Recording, made: Predictions) -> tuple[FloatArray, FloatArray]:
    """Return the predictions ``made`` as a curve for a figure: t (M,) s, angle (M, 3) rad.

    The curve consists of successive prediction windows. Each window starts at the measured angles,
    lasts ``made.window_s`` (s) and ends with a row of NaN.
    """
    h = [float(x) for x in made.instants_s]
    steps = [0, *(max(1, round(x / recording.dt)) for x in h)]
    times, angles = [], []
    for start in range(0, len(recording) - 1, steps[-1]):
        rows = [start + s for s in steps if start + s < len(recording)]
        path = [recording.angle[start]]
        path += [made.ahead[x][k] for x, k in zip(h, rows[1:], strict=False)]
        times += [*recording.t[rows], np.nan]
        angles += [*path, np.full(3, np.nan)]
    return np.array(times), np.array(angles)


def _rms(error: FloatArray, rows: BoolArray | None) -> FloatArray:
    """Return the RMS (3,) of the finite errors (N, 3) in ``rows`` (N, 3); NaN if there are none."""
    use = np.isfinite(error) if rows is None else np.isfinite(error) & rows
    count = use.sum(axis=0)
    # A diverging prediction is a large finite number, whose square overflows to infinity.
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        total = (np.where(use, error, 0.0) ** 2).sum(axis=0)
        return np.asarray(np.where(count > 0, np.sqrt(total / count), np.nan))
