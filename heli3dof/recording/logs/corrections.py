"""Correct a log's times and voltages, so that they are those of the motion.

`sampling_clock.sampling_times` corrects the times. Some logs contain the controller's voltages
instead of those that the amplifier applied to the motors, v (V):

    v = clip(v_log, −v_max, v_max)

v_max is the amplifier's limit in the profile. A log with voltages above it may also belong to
another amplifier: the integrity check ``voltage.limit`` decides which.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.logs.sampling_clock import sampling_times
from heli3dof.recording.recording import Recording


def corrected(recording: Recording) -> Recording:
    """Return the recording with the times of its samples and with limited voltages."""
    return limited(sampling_times(recording))


def limited(recording: Recording) -> Recording:
    """Return the recording with voltages limited to ±v_max; the same object if none exceeds it."""
    v_max = recording.profile.motor.v_max
    if not (np.abs(recording.voltage) > v_max).any():
        return recording
    return replace(recording, voltage=np.clip(recording.voltage, -v_max, v_max))
