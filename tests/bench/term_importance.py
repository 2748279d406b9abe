"""Compute how much the prediction error increases without each term of a grey-box model.

    share_t = RMSE(model without term t) − RMSE(model)      over `HORIZON_S`, degrees

A term is a physical effect of the model, on one axis if the effect is defined by axis.

"Without" sets the term's parameters to the values at which the term has no effect. A parameter on a
logarithmic scale has no such value and gets its lowest allowed one. The other parameters keep their
values. So the share measures how the fitted model uses a term, not the error of a model refitted
without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.comparison.prediction import (
    STEPS_AVERAGED,
    ConstantAngles,
    over_window_deg,
    predictions,
    rmse_deg,
)
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

HORIZON_S = 3.0


@dataclass(frozen=True, eq=False)
class Share:
    """Prediction errors of a grey-box model with and without one of its terms."""

    term: str
    without_deg: np.ndarray
    """(3,) RMSE over a prediction window without the term, degrees, by axis"""
    whole_deg: np.ndarray
    """(3,) RMSE over a prediction window with the term, degrees, by axis"""


def shares(
    model: GreyBoxModel, recordings: Sequence[Recording], horizon_s: float = HORIZON_S
) -> tuple[Share, ...]:
    """Return each term's `Share`: RMSE with and without it, over windows of ``horizon_s`` s."""
    whole = error_deg(model, recordings, horizon_s)
    return tuple(
        Share(t, error_deg(without(model, t), recordings, horizon_s), whole) for t in model.terms
    )


def without(model: GreyBoxModel, term: str) -> GreyBoxModel:
    """Return the model without ``term``; parameters of other terms keep their values."""
    values = model.values.copy()
    free = model.structure.free
    own = {f.name for f in free if f.term == term}
    for j, f in enumerate(free):
        if f.name in own:
            values[j] = f.low if f.log else f.null
    varying = {k: v for k, v in model.varying.items() if k not in own}
    return replace(model, values=values, varying=varying)


def error_deg(
    model: GreyBoxModel | ConstantAngles, recordings: Sequence[Recording], horizon_s: float
) -> np.ndarray:
    """Return the RMSE (3,) in degrees of a model's predictions over windows of ``horizon_s`` s."""
    squares = []
    for r in recordings:
        made = predictions(model, r, (horizon_s,), steps=STEPS_AVERAGED)
        squares.append(over_window_deg(rmse_deg(r, made), made) ** 2)
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))
