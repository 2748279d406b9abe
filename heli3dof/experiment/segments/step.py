"""``step``: the references jump to new values and stay there.

r_ref(t) = r_1 for t ≥ 0 (the controller's own limiter turns the jump into 45°/s).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from heli3dof.experiment.segments import BaseSegment, Clock


class Segment(BaseSegment):
    kind: Literal["step"] = "step"

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.tile(self.target(before), (clock.n, 1)), np.zeros((clock.n, 2))
