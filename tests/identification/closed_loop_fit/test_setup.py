"""On which axes a diagnosis can name effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.identification.closed_loop_fit.setup import Setup
from heli3dof.recording.recording import Recording, recording_of_arrays
from heli3dof.rig.profile import default_profile


def log(**lost: int) -> Recording:
    """Ten rows without the angles that are named."""
    angle = np.zeros((10, 3))
    r = recording_of_arrays(np.arange(10) * 0.002, np.zeros((10, 2)), angle, default_profile())
    angle[:, list(lost.values())] = np.nan
    return replace(r, angle=angle)


def test_without_pitch_no_effect_on_yaw_can_be_named() -> None:
    def explained(r: Recording) -> list[str]:
        return Setup((r,), 0, 6).explained_axes

    assert explained(log()) == ["roll", "pitch", "yaw"]
    assert explained(log(pitch=1)) == ["roll"]
    assert explained(log(yaw=2)) == ["roll", "pitch"]
