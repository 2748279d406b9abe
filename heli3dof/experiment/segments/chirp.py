"""``chirp``: a sine with rising frequency, added to the voltages.

    s(t) = sin φ(t),  φ(t) = 2π f_1 (k^(t/T) − 1) T / ln k,  k = f_2/f_1    (exponential sweep)
    V_front += (common_V + difference_V) s,   V_back += (common_V − difference_V) s

T is ``duration_s``, (f_1, f_2) is ``band_Hz``. The instantaneous frequency is f_1 k^(t/T), so every
octave lasts equally long. On pitch the chirp separates a lag from a delay, whose phases differ at
high frequency.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.experiment.segments import Band, BaseSegment, Clock
from heli3dof.toml_file import Finite, Key


class Segment(BaseSegment):
    kind: Literal["chirp"] = "chirp"
    band_Hz: Band = (0.1, 8.0)
    common_V: Annotated[Finite, Key("amplitude on both motors alike", "V")] = 0.0
    difference_V: Annotated[Finite, Key("amplitude on front, opposite on back", "V")] = 1.0

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        f1, f2 = self.band_Hz
        T = clock.n * clock.dt
        k = f2 / f1
        phase = 2 * np.pi * f1 * T / np.log(k) * (k ** (clock.t / T) - 1)
        front, back = self.common_V + self.difference_V, self.common_V - self.difference_V
        reference, _ = super().render(clock, before)
        return reference, np.sin(phase)[:, None] * np.array([front, back])

    def details(self) -> str:
        return (
            f"{self.common_V:g} V common and {self.difference_V:g} V "
            f"difference, {self.band_Hz[0]:g} to {self.band_Hz[1]:g} Hz"
        )
