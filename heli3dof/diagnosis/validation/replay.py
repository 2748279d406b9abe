"""Table II of the paper before and after: overshoot and steady error in closed-loop replay.

Where the loop is known both models fly the recording's own references through its controller
(`heli3dof.comparison.replay`), and are measured as the flight itself was
(`heli3dof.comparison.metrics`). What the loop hides, it hides here too: a delay may show as
overshoot only, a friction as a steady error only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.metrics import step_metrics
from heli3dof.comparison.replay import replay
from heli3dof.model.control.loop_task import under_control, why_not_replayed
from heli3dof.model.greybox.model import GreyBoxModel
from heli3dof.recording.recording import Recording


@dataclass(frozen=True)
class Replayed:
    """One axis of one recording, degrees; NaN where it is not defined or the model diverges."""

    recording: str
    axis: str
    overshoot_deg: tuple[float, float, float]
    """in the experiment, before, after"""
    steady_error_deg: tuple[float, float, float]


def replayed(
    before: GreyBoxModel, after: GreyBoxModel, recordings: Sequence[Recording]
) -> tuple[Replayed, ...]:
    """Every axis of every recording whose loop is known and whose reference steps or rests."""
    out = []
    for recording in recordings:
        if why_not_replayed(recording) is not None:
            continue
        flown = under_control(recording)
        grain = np.abs(recording.profile.encoder.rad_per_count)
        flights = [flown.angle, *(replay(m, recording).angle for m in (before, after))]
        metrics = [
            step_metrics(flown.t, angle, flown.reference, resolution=grain) for angle in flights
        ]
        for axis in AXES:
            shown = [m[axis].reported for m in metrics]
            if shown[0].kind not in ("step", "start", "hold"):
                continue
            a, b, c = (s.overshoot_deg for s in shown)
            d, e, f = (s.steady_error_deg for s in shown)
            out.append(Replayed(recording.name, axis, (a, b, c), (d, e, f)))
    return tuple(out)
