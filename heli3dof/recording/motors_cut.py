"""Warns of a log that ends with the motors at zero in flight: a crash, or a cut of the power."""

from __future__ import annotations

import numpy as np

from heli3dof.errors import minus
from heli3dof.recording.recording import Recording

ZERO = 0.01
"""Largest voltage, as a share of v_max, of a motor that is off. Chosen, as are the constants
below."""
IN_FLIGHT = np.radians(5.0)
"""rad: least roll above the lowest roll of the recording with which a rig counts as in flight"""
LEAST_S = 0.2
"""s: shortest time with the motors at zero"""


def motors_cut_warnings(recording: Recording) -> list[str]:
    """Return a list with a warning if the motors went to zero in flight, until the log's end.

    The warning states the time of the cut, and the roll angle at which the arm came to rest. The
    list is empty if the recording states how the flight ended (its outcome), or has no roll angle.
    """
    r = recording
    if "outcome" in r.meta or "roll" not in r.axes:
        return []
    roll = r.angle[:, 0]
    powered = np.flatnonzero((np.abs(r.voltage) > ZERO * r.profile.motor.v_max).any(axis=1))
    if not powered.size or powered[-1] + 1 >= len(r):
        return []
    cut = int(powered[-1]) + 1
    off_s = float(r.t[-1] - r.t[cut])
    if off_s < LEAST_S or not roll[cut] > np.nanmin(roll) + IN_FLIGHT:
        return []
    step = abs(float(r.profile.encoder.rad_per_count[0]))
    moving = np.flatnonzero(np.abs(roll - roll[-1]) > 1.5 * step)
    rest = max(int(moving[-1]) + 1 if moving.size else cut, cut)
    text = f"The motors went to zero in flight at {r.t[cut]:.4g} s, at a roll of "
    text += f"{np.degrees(roll[cut]):.1f}°. "
    if r.t[-1] - r.t[rest] > LEAST_S:
        text += (
            f"From {r.t[rest]:.4g} s on, roll stays at {np.degrees(roll[-1]):.1f}° for "
            f"{r.t[-1] - r.t[rest]:.3g} s."
        )
    else:
        text += f"The log ends {off_s:.3g} s later, at {np.degrees(roll[-1]):.1f}°."
    return [minus(text)]
