"""What each term of a grey box is worth: its prediction error without the term, not refitted.

    share_t = RMSE(model, term t at its null) − RMSE(model)      over `HORIZON_S`, degrees

The other parameters stay where they are, so this says how much the *fitted* model leans on a term,
not how well a model without it could do. A log-parameter has no null: it goes to its lowest value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.comparison.prediction import (
    STEPS_AVERAGED,
    HeldStill,
    over_window_deg,
    predictions,
    rmse_deg,
)
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording

HORIZON_S = 3.0


@dataclass(frozen=True, eq=False)
class Share:
    """One term, and the model's error without it."""

    term: str
    without_deg: np.ndarray
    """(3,) RMSE over the window"""
    whole_deg: np.ndarray
    """(3,) the same with the term"""


def shares(
    model: GreyBoxModel, recordings: Sequence[Recording], horizon_s: float = HORIZON_S
) -> tuple[Share, ...]:
    """One per term, in the model's order; mean squares are averaged over the recordings."""
    whole = error_deg(model, recordings, horizon_s)
    return tuple(
        Share(t, error_deg(without(model, t), recordings, horizon_s), whole) for t in model.terms
    )


def without(model: GreyBoxModel, term: str) -> GreyBoxModel:
    """The model with the term's parameters where it is absent, and nothing refitted."""
    values = model.values.copy()
    free = model.structure.free
    own = {f.name for f in free if f.term == term}
    for j, f in enumerate(free):
        if f.name in own:
            values[j] = f.low if f.log else f.null
    varying = {k: v for k, v in model.varying.items() if k not in own}
    return replace(model, values=values, varying=varying)


def error_deg(
    model: GreyBoxModel | HeldStill, recordings: Sequence[Recording], horizon_s: float
) -> np.ndarray:
    """(3,) RMSE over all samples of windows of that length."""
    squares = []
    for r in recordings:
        made = predictions(model, r, (horizon_s,), steps=STEPS_AVERAGED)
        squares.append(over_window_deg(rmse_deg(r, made), made) ** 2)
    return np.asarray(np.sqrt(np.mean(squares, axis=0)))
