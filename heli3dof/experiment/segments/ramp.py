"""``ramp``: the references move at a constant rate to new values, or the voltages to an offset.

    r_ref(t) = r_0 + (r_1 − r_0) t/T                     r_0, r_1: old, new reference
    V_front = V_c,front + (common_V + difference_V) t/T
    V_back  = V_c,back  + (common_V − difference_V) t/T

T is ``duration_s``, V_c the controller's output. A slow ramp of the roll reference shows friction,
a dead zone and the static thrust curve. The controller counteracts the voltage offset. The offset
is zero again after the segment.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.experiment.segments import BaseSegment, Clock
from heli3dof.toml_file import Finite, Key


class Segment(BaseSegment):
    kind: Literal["ramp"] = "ramp"
    common_V: Annotated[Finite, Key("voltage added to both motors at the end of the ramp", "V")] = (
        0.0
    )
    difference_V: Annotated[
        Finite, Key("voltage added to front, subtracted from back, at the end", "V")
    ] = 0.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        share = ((np.arange(clock.n) + 1) / clock.n)[:, None]
        reference = before + (self.target(before) - before) * share
        front, back = self.common_V + self.difference_V, self.common_V - self.difference_V
        return reference, share * np.array([front, back])

    def details(self) -> str:
        return super().details() if self.common_V or self.difference_V else ""
