"""Correct the times of a log's samples, and limit its voltages to those that the motors can get.

`sampling_clock.sampling_times` corrects the times. Some logs contain the controller's output before
the limiter, v_log, instead of the voltages v (V) at the motors:

    v = clip(v_log, −v_max, v_max)

v_max is the amplifier's limit in the profile. If it is wrong, so is v: the integrity check
``voltage.limit`` reports that.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.logs.sampling_clock import sampling_times
from heli3dof.recording.recording import Recording


def corrected(recording: Recording) -> Recording:
    """Return the recording with estimated sampling times and with voltages limited to ±v_max."""
    return limited(sampling_times(recording))


def limited(recording: Recording) -> Recording:
    """Return the recording with voltages limited to ±v_max; the same object if none exceeds it."""
    v_max = recording.profile.motor.v_max
    if not (np.abs(recording.voltage) > v_max).any():
        return recording
    return replace(recording, voltage=np.clip(recording.voltage, -v_max, v_max))
