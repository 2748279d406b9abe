"""``coast-down``: yaw is brought up to speed, then left to itself with the body level.

    learn_s   still: the mean of yaw's share of the voltage is kept (it holds the body level)
    spin_s    the yaw reference moves at rate_deg_per_s
    the rest  p → 0 and J_yaw ψ̈ = − c_ψ ψ̇ − τ_ψ sgn ψ̇ − …:  what slows it is friction alone

Viscous friction shows as exponential decay, Coulomb friction as a straight one that ends in a stop,
drag as one that is steep first. Roll and pitch stay under control; beyond a share of the
envelope yaw is caught too (`heli3dof.model.control.loop_opening`).
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from heli3dof.axes import YAW
from heli3dof.experiment.segments import BaseSegment, Clock
from heli3dof.model.control.loop_opening import LEARN, OPEN
from heli3dof.toml_file import Finite, Key, Positive


class Segment(BaseSegment):
    kind: Literal["coast-down"] = "coast-down"
    rate_deg_per_s: Annotated[Finite, Key("speed at which yaw is let go", "°/s")] = 18.0
    learn_s: Annotated[
        Finite,
        Field(ge=0),
        Key("hover whose mean voltage is kept; 0: what an earlier segment learned", "s"),
    ] = 4.0
    spin_s: Annotated[Positive, Key("time to come up to speed", "s")] = 6.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reference = np.tile(self.target(before), (clock.n, 1))
        turned = np.clip(clock.t - self.learn_s, 0.0, self.spin_s)
        reference[:, YAW] += np.radians(self.rate_deg_per_s) * turned
        return reference, np.zeros((clock.n, 2))

    def opened(self, clock: Clock) -> np.ndarray:
        mode = super().opened(clock)
        mode[clock.t < self.learn_s, YAW] = LEARN
        mode[clock.t >= self.learn_s + self.spin_s, YAW] = OPEN
        return mode

    def summary(self) -> str:
        free = max(0.0, self.duration_s - self.learn_s - self.spin_s)
        return super().summary() + f", let go of {self.rate_deg_per_s:g}°/s for {free:g} s"
