"""``hold``: the references stay constant; the rig settles."""

from __future__ import annotations

from typing import Literal

from heli3dof.experiment.segments import BaseSegment


class Segment(BaseSegment):
    kind: Literal["hold"] = "hold"
