"""``doublet``: a pulse up and one down on the common voltage, the difference or both.

    c(t) = +common_V for 0 ≤ t < T_p,  −common_V for T_p ≤ t < 2 T_p,  then 0
    d(t) the same with difference_V;   V_front += c + d,  V_back += c − d

T_p is ``pulse_s``. Doublets on pitch at two mean voltages separate a lag from a delay.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.experiment.segments import BaseSegment, Clock
from heli3dof.toml_file import Finite, Key, Positive


class Segment(BaseSegment):
    kind: Literal["doublet"] = "doublet"
    pulse_s: Annotated[Positive, Key("length of each of the two pulses", "s")] = 0.2
    common_V: Annotated[Finite, Key("amplitude on both motors alike", "V")] = 0.0
    difference_V: Annotated[Finite, Key("amplitude on front, opposite on back", "V")] = 1.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pulse = np.floor(clock.t / self.pulse_s + 1e-9)
        shape = np.select([pulse == 0, pulse == 1], [1.0, -1.0], 0.0)
        front, back = self.common_V + self.difference_V, self.common_V - self.difference_V
        reference, _ = super().render(clock, before)
        return reference, shape[:, None] * np.array([front, back])

    def details(self) -> str:
        return (
            f"{self.common_V:g} V common and {self.difference_V:g} V "
            f"difference for {self.pulse_s:g} s each way"
        )
