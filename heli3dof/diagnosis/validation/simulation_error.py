"""How wrong a simulation is, per axis and horizon, beside what noise alone would do; and where.

Errors from re-estimated states over 0.1, 0.3, 1 and 3 s (`validation.prediction`). The floor is
that of another model where one is given (the extended one: the base fit's noise has swallowed what
the base lacks). The worst stretch of each axis is the window of `WINDOW_S` in which the error over
`HORIZON_S` has the largest mean square.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.diagnosis.validation.prediction import (
    HORIZONS_S,
    Ahead,
    floor_deg,
    mean_square,
    model_ahead,
)
from heli3dof.model.estimation.filter_data import Data
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

HORIZON_S = 1.0
WINDOW_S = 3.0


@dataclass(frozen=True)
class WorstStretch:
    """Where one axis is furthest off: s on the recording's clock, counted from its first sample."""

    axis: str
    recording: str
    start_s: float
    stop_s: float
    rmse_deg: float


@dataclass(frozen=True, eq=False)
class HowWrong:
    """H horizons."""

    horizons_s: tuple[float, ...]
    rmse_deg: np.ndarray
    """(H, 3); NaN where an axis was not measured"""
    floor_deg: np.ndarray
    """(H, 3)"""
    floor_by: str
    """How the floor was found"""
    worst: tuple[WorstStretch, ...]
    """One per measured axis"""

    def at(self, horizon_s: float, axis: str) -> tuple[float, float]:
        """(RMSE, floor) in degrees."""
        h, i = self.horizons_s.index(horizon_s), AXES.index(axis)
        return float(self.rmse_deg[h, i]), float(self.floor_deg[h, i])


def how_wrong(
    model: GreyBoxModel,
    recordings: Sequence[Recording],
    *,
    truth: GreyBoxModel | None = None,
    horizons_s: Sequence[float] = HORIZONS_S,
    flights: int = 2,
    seed: int = 0,
) -> HowWrong:
    """A model's errors on recordings; the floor is that of ``truth`` (the model itself).

    Raises RecordingError where no row is usable.
    """
    problem, e = model_ahead(model, recordings, horizons_s)
    floor, by = floor_deg(truth or model, recordings, horizons_s, flights=flights, seed=seed)
    return HowWrong(tuple(horizons_s), e.rmse_deg(), floor, by, _worst(problem.data, e, recordings))


def _worst(d: Data, e: Ahead, recordings: Sequence[Recording]) -> tuple[WorstStretch, ...]:
    nearest = int(np.argmin(np.abs(np.array(e.horizons_s) - HORIZON_S)))
    horizon = e.horizons_s[nearest]
    errors = e.errors[:, nearest]
    found: dict[int, WorstStretch] = {}
    for run, (_, start, stop) in zip(d.runs, d.blocks, strict=True):
        inside = (e.starts >= start) & (e.starts < stop)
        t = d.t[e.starts[inside]] + horizon  # where the prediction is compared
        if not inside.any():
            continue
        last = float(d.t[stop - 1])
        for low in np.arange(t[0], max(last - WINDOW_S, t[0]) + 1e-9, WINDOW_S / 3):
            window = (t >= low) & (t < low + WINDOW_S)
            rmse = np.degrees(np.sqrt(mean_square(errors[inside][window])))
            for i in (i for i in range(3) if np.isfinite(rmse[i])):
                if i not in found or rmse[i] > found[i].rmse_deg:
                    found[i] = WorstStretch(
                        AXES[i], recordings[run.source].name, float(low),
                        float(min(low + WINDOW_S, last)), float(rmse[i]),
                    )  # fmt: skip
    return tuple(found[i] for i in sorted(found))
