"""Warns of an encoder whose count did not change at the end of a flight.

Either dry friction held the axis, or its encoder is frozen; the recording cannot distinguish the
two. Dry friction of 0.05 N·m holds the emulated rig's yaw axis for 16 s of a flight with a roll
step. The safety monitor `frozen_encoder` simulates an axis while its count is constant. It ends the
flight only if the simulated axis has turned.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP

STILL_S = 5.0
"""s: a longer constant count gives a warning. Without dry friction the longest was 3.2 s,
in 12 emulated flights with a third to three times the default torque noise."""


def still_encoder_warnings(recording: Recording) -> list[str]:
    """Return a warning for each axis whose count was constant at the end for over `STILL_S` s.

    Only the time under closed-loop control counts. The list is empty for a flight that did not
    complete; its outcome then states the reason.
    """
    phase = recording.channels.get("phase")
    if phase is None or recording.meta.get("outcome") != "completed":
        return []
    flown = np.flatnonzero(phase == CLOSED_LOOP)
    warnings = []
    for axis in AXES:
        count = recording.channels.get(f"{axis}_count")
        if count is None or not flown.size:
            continue
        last = flown[-1]
        other = flown[count[flown] != count[last]]
        since = other[-1] if other.size else flown[0]
        still_s = float(recording.t[last] - recording.t[since])
        if still_s > STILL_S:
            warnings.append(
                f"The {axis} encoder's count did not change in the last {still_s:.0f} s of the "
                "flight. Likely cause: dry friction held the axis, or its encoder is frozen; the "
                f"recording does not show which. Try: heli3dof monitor and turn {axis} by hand: "
                "does its angle follow?"
            )
    return warnings
