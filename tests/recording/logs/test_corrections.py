"""The applied voltages of a log that contains the controller's output."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.logs.corrections import corrected, limited
from heli3dof.recording.recording import recording_of_arrays
from heli3dof.rig.profile import default_profile


def test_voltages_beyond_the_limit_become_the_limit() -> None:
    profile = default_profile()
    v_max = profile.motor.v_max
    t = np.arange(20) * profile.dt
    volts = np.linspace(-2 * v_max, 2 * v_max, 40).reshape(20, 2)
    r = recording_of_arrays(t, volts, np.zeros((20, 3)), profile)
    assert np.array_equal(limited(r).voltage, np.clip(volts, -v_max, v_max))
    assert corrected(r).voltage.max() == v_max
    within = replace(r, voltage=volts / 2)
    assert corrected(within) is within
