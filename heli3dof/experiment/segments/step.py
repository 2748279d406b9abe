"""``step``: the references jump to new values and stay there.

r_ref(t) = r_1 for t ≥ 0, with the new reference r_1. The controller limits the reference's rate, by
default to 45°/s.
"""

from __future__ import annotations

from typing import Literal

from heli3dof.experiment.segments import BaseSegment


class Segment(BaseSegment):
    kind: Literal["step"] = "step"
