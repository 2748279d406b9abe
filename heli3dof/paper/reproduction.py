"""The reproducible part of the published table: the hover model's column.

The paper simulates the hover model: a 10° roll step from level, K_g of (14), no limits reached.
With the contract's sampled controller the peak is 11.75° (11.85° in continuous time with ideal
rates); the paper prints 12°. All other numbers need a recording that was never published.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.metrics import AxisMetrics, step_metrics
from heli3dof.model.base import LoopTask, Model
from heli3dof.paper.published import TABLE_II, TEXT, Published
from heli3dof.rig.profile import ControllerSpec, Profile, default_profile

STEP_DEG, DURATION_S = 10.0, 10.0
"""°, s: the paper's roll step."""


@dataclass(frozen=True)
class Reproduced:
    """A printed number with ours; NaN if it cannot be reproduced."""

    published: Published
    ours_deg: float

    def to_dict(self) -> dict[str, Any]:
        """The row of ``compare --json``; None if the number cannot be reproduced."""
        ours = float(self.ours_deg)
        return {**asdict(self.published), "ours_deg": ours if isfinite(ours) else None}


def paper_step(profile: Profile | None = None) -> LoopTask:
    """The paper's task: a 10° roll step from level hover, 10 s, on the rig of Table I."""
    profile = profile or default_profile()
    n = round(DURATION_S / profile.dt) + 1
    return LoopTask(
        reference=np.tile(np.radians([STEP_DEG, 0.0, 0.0]), (n, 1)),
        extra=np.zeros((n, 2)),
        angle0=np.zeros(3),
        controller=profile.controller or ControllerSpec(),
        V_o=profile.motor.V_o,
        v_max=profile.motor.v_max,
        dt=profile.dt,
    )


def hover_metrics(hover: Model, profile: Profile | None = None) -> Mapping[str, AxisMetrics]:
    """Step metrics per axis of the hover model in the paper's step."""
    task = paper_step(profile)
    result = hover.fly(task)
    return step_metrics(result.t, result.angle, task.reference)


def reproduce(hover: Model | None) -> tuple[Reproduced, ...]:
    """All printed numbers with ours: the figures of the text, then Table II.

    ``hover`` is the corrected hover model of Table I's rig; with None nothing is simulated.
    """
    metrics = None if hover is None else hover_metrics(hover)
    rows = []
    for number in (*TEXT, *TABLE_II):
        ours = np.nan
        if metrics is not None and number.reproducible:
            step = metrics[number.axis].reported
            ours = step.peak_deg if number.quantity == "peak" else abs(step.steady_error_deg)
        rows.append(Reproduced(number, float(ours)))
    return tuple(sorted(rows, key=lambda r: AXES.index(r.published.axis)))
