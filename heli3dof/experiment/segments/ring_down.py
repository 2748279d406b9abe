"""``ring-down``: roll swings freely, its share of the voltage frozen at what level hover took.

    learn_s    level: the mean of roll's share of the voltage is kept
    settle_s   displaced by displacement_deg
    the rest   J_roll r̈ = L_a cos p F − T_g cos r − k_r sin r − c_r ṙ − …,   F constant

What swings is the rig alone: a pendulum's stiffness is the swing's frequency √(k_r/J_roll), its
friction the decay. Without stiffness roll stays, or drifts. Pitch and yaw stay under control;
beyond a share of the envelope roll is caught too (`heli3dof.model.control.loop_opening`).
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from heli3dof.axes import ROLL
from heli3dof.experiment.segments import BaseSegment, Clock
from heli3dof.model.control.loop_opening import LEARN, OPEN
from heli3dof.toml_file import Finite, Key, Positive


class Segment(BaseSegment):
    kind: Literal["ring-down"] = "ring-down"
    displacement_deg: Annotated[
        Finite, Key("roll, above its reference, at which it is let go", "°")
    ] = 8.0
    learn_s: Annotated[
        Finite,
        Field(ge=0),
        Key("hover whose mean voltage is kept; 0: what an earlier segment learned", "s"),
    ] = 4.0
    settle_s: Annotated[Positive, Key("time to get there", "s")] = 5.0

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
