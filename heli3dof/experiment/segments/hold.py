"""``hold``: the references stay constant; the rig settles."""

from __future__ import annotations

from typing import Literal

import numpy as np

from heli3dof.experiment.segments import BaseSegment, Clock


class Segment(BaseSegment):
    kind: Literal["hold"] = "hold"

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.tile(self.target(before), (clock.n, 1)), np.zeros((clock.n, 2))
