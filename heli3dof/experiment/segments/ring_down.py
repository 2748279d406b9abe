"""``ring-down``: roll swings freely, its share of the voltage frozen at what level hover took.

    learn_s    level: the mean of roll's share of the voltage is kept
    settle_s   displaced by displacement_deg
    the rest   J_roll r̈ = L_a cos p F − T_g cos r − k_r sin r − c_r ṙ − …,   F constant

What swings is the rig alone: a pendulum's stiffness is the swing's frequency √(k_r/J_roll), its
friction the decay. Without stiffness roll stays, or drifts. Pitch and yaw stay under control;
beyond a share of the envelope roll is caught too (`heli3dof.model.opened`).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from heli3dof.axes import ROLL
from heli3dof.experiment.segments import BaseSegment, Clock
from heli3dof.model.opened import LEARN, OPEN
from heli3dof.toml_file import Finite, Positive


class Segment(BaseSegment):
    kind: Literal["ring-down"] = "ring-down"
    displacement_deg: Finite = 8.0
    learn_s: Finite = Field(default=4.0, ge=0)
    """0: what an earlier segment of the flight learned is used again"""
    settle_s: Positive = 5.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reference = np.tile(self.target(before), (clock.n, 1))
        lifted = (clock.t >= self.learn_s) & (clock.t < self.learn_s + self.settle_s)
        reference[lifted, ROLL] += np.radians(self.displacement_deg)
        return reference, np.zeros((clock.n, 2))

    def opened(self, clock: Clock) -> np.ndarray:
        mode = super().opened(clock)
        mode[clock.t < self.learn_s, ROLL] = LEARN
        mode[clock.t >= self.learn_s + self.settle_s, ROLL] = OPEN
        return mode

    def summary(self) -> str:
        free = max(0.0, self.duration_s - self.learn_s - self.settle_s)
        return super().summary() + f", let go of {self.displacement_deg:g}° for {free:g} s"
