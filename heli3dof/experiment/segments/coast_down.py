"""``coast-down``: the controller spins yaw up, then lets it coast with the body level.

    learn_s   in hover, the mean of the yaw feedback is measured
    spin_s    the yaw reference moves at rate_deg_per_s, so yaw speeds up
    the rest  the yaw loop is open, and friction slows yaw:

              J_yaw ψ̈ = − c_ψ ψ̇ − τ_ψ sgn ψ̇ − …

The yaw feedback is the part of each motor's voltage (V) that the controller computes from the yaw
error, the yaw rate and the integrated yaw error. This feedback tilts the body, because only a
tilted thrust turns yaw. In the open loop, a constant replaces the feedback: its mean in hover. The
pitch loop then levels the body, so the thrust no longer turns yaw.

ψ is yaw (rad), J_yaw its inertia (kg·m²). Viscous friction c_ψ causes an exponential decay of the
yaw rate, and Coulomb friction τ_ψ causes a linear decay. Drag causes a decay that is steepest at
first. Roll and pitch stay in closed loop. Yaw returns to closed loop if an angle or rate exceeds a
fraction of its safety limit (`heli3dof.model.control.controller`).
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.axes import YAW
from heli3dof.experiment.segments import Clock, FreeSegment
from heli3dof.toml_file import Finite, Key, Positive


class Segment(FreeSegment):
    axis = YAW
    kind: Literal["coast-down"] = "coast-down"
    rate_deg_per_s: Annotated[Finite, Key("yaw rate when the loop opens", "°/s")] = 18.0
    spin_s: Annotated[Positive, Key("time to come up to speed", "s")] = 6.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        reference, extra = super().render(clock, before)
        turned = np.clip(clock.t - self.learn_s, 0.0, self.spin_s)
        reference[:, YAW] += np.radians(self.rate_deg_per_s) * turned
        return reference, extra

    @property
    def approach_s(self) -> float:
        return self.spin_s

    def details(self) -> str:
        return f"released at {self.rate_deg_per_s:g}°/s for {self.free_s:g} s"
