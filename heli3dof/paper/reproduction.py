"""Reproduce the paper's numbers for the hover model; no other number can be reproduced.

The paper simulates a 10° roll step of the hover model from level, with the gain K_g of eq (14). No
voltage limit is reached. The roll peak is 11.75° with this package's sampled controller, and 11.85°
in continuous time with ideal rates. The paper prints 12°. The numbers of the experiment need its
unpublished recording. Those of the identified model need eq (17), which is misprinted
(`heli3dof.paper.published`).
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
from heli3dof.rig.profile import ControllerSpec, default_profile

STEP_DEG, DURATION_S = 10.0, 10.0
"""Size (°) of the paper's roll step, and duration (s) of its simulation"""


@dataclass(frozen=True)
class Reproduced:
    """A number that the paper prints, and the simulated number (NaN if none), in degrees."""

    published: Published
    ours_deg: float

    def to_dict(self) -> dict[str, Any]:
        """Return a dict of the paper's number and the simulated one, for ``compare --json``.

        ``ours_deg`` is the simulated number, or None if there is none (NaN).
        """
        ours = float(self.ours_deg)
        return {**asdict(self.published), "ours_deg": ours if isfinite(ours) else None}


def paper_step() -> LoopTask:
    """Return the closed-loop task of the paper's simulation: a 10° roll step of Table I's rig."""
    profile = default_profile()
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


def reproduce(hover: Model | None) -> tuple[Reproduced, ...]:
    """Return the paper's numbers, each with its simulated value (NaN if none), sorted by axis.

    ``hover`` is the corrected hover model of Table I's rig. If it is None, all simulated values are
    NaN.
    """
    metrics: Mapping[str, AxisMetrics] | None = None
    if hover is not None:
        task = paper_step()
        result = hover.fly(task)
        metrics = step_metrics(result.t, result.angle, task.reference)
    rows = []
    for number in (*TEXT, *TABLE_II):
        ours = np.nan
        if metrics is not None and number.reproducible:
            step = metrics[number.axis].reported
            ours = step.peak_deg if number.quantity == "peak" else abs(step.steady_error_deg)
        rows.append(Reproduced(number, float(ours)))
    return tuple(sorted(rows, key=lambda r: AXES.index(r.published.axis)))
