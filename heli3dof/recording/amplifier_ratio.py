"""Warns of an amplifier whose output voltages differ from the commanded voltages.

The module divides the closed-loop part of a recording into intervals of 1 s. For each motor and
each interval, it computes::

    ratio = mean of the output voltage / mean of the commanded voltage

It warns if a ratio differs from 1 by more than `LARGEST_ERROR`. The safety monitor
`amplifier_output` ends a flight only at a much larger error. A smaller error has harmless causes: a
loaded supply, or an inaccurate measurement of the output. It does not justify the end of the
flight, because the arm then falls.
"""

from __future__ import annotations

import numpy as np

from heli3dof.axes import MOTORS
from heli3dof.recording.recording import Recording
from heli3dof.recording.row import CLOSED_LOOP
from heli3dof.rig.interface import Flags

LARGEST_ERROR = 0.1
"""Largest |ratio − 1| without a warning: measured voltages have errors of a few percent"""
BLOCK_S = 1.0
"""s: a latency of 50 ms changes the mean over this time by a few percent at most"""
LEAST = 0.25
"""Least mean command of a block, over the profile's hover voltage"""


def amplifier_warnings(recording: Recording) -> list[str]:
    """Return a warning for each motor whose output voltage differs from the commanded voltage.

    For each second in closed loop, the function divides the mean output voltage by the mean
    commanded voltage. It warns if a ratio differs from 1 by more than `LARGEST_ERROR`, and states
    the ratio farthest from 1. Samples with the flag SATURATED do not count. A recording without
    commanded voltages, such as an imported log, gives no warning.
    """
    channels, profile = recording.channels, recording.profile
    warnings = []
    for i, motor in enumerate(MOTORS):
        sent = channels.get(f"v_{motor}_sent_V")
        if sent is None or "phase" not in channels or "flags" not in channels:
            continue
        output = recording.voltage[:, i]
        saturated = channels["flags"].astype(int) & int(Flags.SATURATED)
        used = (channels["phase"] == CLOSED_LOOP) & (saturated == 0) & np.isfinite(output)
        n = round(BLOCK_S / profile.dt)
        blocks = int(used.sum()) // n
        command_V, output_V = (
            v[used][: blocks * n].reshape(blocks, n).mean(axis=1) for v in (sent, output)
        )
        enough = np.abs(command_V) > LEAST * profile.motor.hover_V
        if not enough.any():
            continue
        ratios = output_V[enough] / command_V[enough]
        worst = float(ratios[np.argmax(np.abs(ratios - 1))])
        if abs(worst - 1) > LARGEST_ERROR:
            warnings.append(
                f"The {motor} motor's output was {worst:.2f} times the commanded voltage, in the "
                "mean of a second. Likely cause: a loaded supply, or a wrong scale of the "
                "amplifier's output or of its measurement. Try: a voltmeter at the motor; "
                "python -m heli3dof.rig.conformance URL examines the driver"
            )
    return warnings
