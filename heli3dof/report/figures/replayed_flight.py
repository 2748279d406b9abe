"""Compute overshoot and steady error in closed-loop replay (the paper's Table II) of two models.

Both models are simulated with the recording's references (`heli3dof.comparison.replay`). The same
metrics are computed for both simulations and for the flight (`heli3dof.comparison.metrics`).
Feedback hides some effects: a delay may show only in the overshoot, friction only in the steady
error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.metrics import metrics_in_flight
from heli3dof.comparison.replay import replay
from heli3dof.model.control.loop_task import under_control, why_not_replayed
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording


@dataclass(frozen=True)
class Replayed:
    """Overshoot and steady error (°) of one axis, in a flight and in two models' replays.

    NaN if undefined (as the overshoot of a held axis) or if the model diverges.
    """

    recording: str
    axis: str
    overshoot_deg: tuple[float, float, float]
    """In the experiment, with the model ``before``, with the model ``after``"""
    steady_error_deg: tuple[float, float, float]
    """In the order of ``overshoot_deg``"""


def replayed(
    before: GreyBoxModel, after: GreyBoxModel, recordings: Sequence[Recording]
) -> tuple[Replayed, ...]:
    """Return overshoot and steady error of each flight, and of its replays with two models.

    There is one result for each recording and each axis with a step or constant reference.

    ``before``, ``after``: models without and with the causes. Recordings that cannot be replayed
    are omitted, such as those with an unknown controller.
    """
    out = []
    for recording in recordings:
        if why_not_replayed(recording) is not None:
            continue
        recorded = under_control(recording)
        flights = [recorded.angle, *(replay(m, recording).angle for m in (before, after))]
        metrics = [metrics_in_flight(recorded, angle) for angle in flights]
        for axis in AXES:
            results = [m[axis].reported for m in metrics]
            if results[0].kind not in ("step", "start", "hold"):
                continue
            held = results[0].kind == "hold"
            a, b, c = (np.nan if held else s.overshoot_deg for s in results)
            d, e, f = (s.steady_error_deg for s in results)
            out.append(Replayed(recording.name, axis, (a, b, c), (d, e, f)))
    return tuple(out)
