"""``prbs``: pseudo-random binary signals on the common voltage and the difference.

    c(t) = ± common_V,  d(t) = ± difference_V
    V_front += c + d,   V_back += c − d

Each sign is constant for ``bit_s`` seconds, and may then change. The signs are two different
maximum-length sequences (linear feedback shift registers) from random states. Their autocorrelation
has a single peak. A full period of a sequence has one more + than −.
"""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np

from heli3dof.experiment.segments import BaseSegment, Clock
from heli3dof.toml_file import Finite, Key, Positive


class Segment(BaseSegment):
    kind: Literal["prbs"] = "prbs"
    bit_s: Annotated[Positive, Key("shortest time between switches", "s")] = 0.1
    common_V: Annotated[Finite, Key("amplitude on both motors alike", "V")] = 0.5
    difference_V: Annotated[Finite, Key("amplitude on front, opposite on back", "V")] = 0.5

    def render(self, clock: Clock, before: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        from scipy.signal import max_len_seq

        hold = max(1, round(self.bit_s / clock.dt))
        bits = -(-clock.n // hold)
        shapes = []
        for order, amplitude in ((9, self.common_V), (10, self.difference_V)):
            state = clock.rng.integers(0, 2, order)
            state[0] = 1  # all zeros would never leave zero
            sequence, _ = max_len_seq(order, state=state, length=bits)
            shapes.append(amplitude * np.repeat(2.0 * sequence - 1, hold)[: clock.n])
        c, d = shapes
        reference, _ = super().render(clock, before)
        return reference, np.column_stack([c + d, c - d])

    def details(self) -> str:
        return (
            f"±{self.common_V:g} V common and ±{self.difference_V:g} V "
            f"difference, bits of {self.bit_s:g} s"
        )
