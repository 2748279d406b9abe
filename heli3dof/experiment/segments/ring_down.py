"""``ring-down``: roll swings freely under the constant voltage that held it level.

    learn_s    in level hover, the mean of the roll feedback is measured
    settle_s   the roll reference is displaced by displacement_deg
    the rest   the roll loop is open, so the thrust F is constant:

               J_roll r̈ = L_a cos p F − T_g cos r − k_r sin r − c_r ṙ − …

The roll feedback is the part of each motor's voltage (V) that the controller computes from the roll
error, the roll rate and the integrated roll error. In the open loop, a constant replaces the
feedback: its mean in hover.

F: sum of both thrusts (N); r, p: roll and pitch (rad); J_roll: inertia (kg·m²); L_a: yaw axis to
body (m); T_g: gravity torque (N·m); k_r: pendulum stiffness (N·m/rad); c_r: viscous friction
(N·m·s/rad). The frequency √(k_r/J_roll) shows k_r, and the decay shows c_r. Without stiffness roll
stays, or drifts. Pitch and yaw stay in closed loop. Roll returns to closed loop if an angle or rate
exceeds a fraction of its safety limit (`heli3dof.model.control.controller`).
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.axes import ROLL
from heli3dof.experiment.segments import Clock, FreeSegment
from heli3dof.toml_file import Finite, Key, Positive


class Segment(FreeSegment):
    axis = ROLL
    kind: Literal["ring-down"] = "ring-down"
    displacement_deg: Annotated[
        Finite, Key("roll above its reference when the loop opens", "°")
    ] = 8.0
    settle_s: Annotated[Positive, Key("time to reach it", "s")] = 5.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reference, extra = super().render(clock, before)
        lifted = (clock.t >= self.learn_s) & (clock.t < self.learn_s + self.settle_s)
        reference[lifted, ROLL] += np.radians(self.displacement_deg)
        return reference, extra

    @property
    def approach_s(self) -> float:
        return self.settle_s

    def details(self) -> str:
        return f"released at {self.displacement_deg:g}° for {self.free_s:g} s"
