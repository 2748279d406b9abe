"""Insert rows for lost samples, so that one row is one control period.

`logs.sampling_clock` counts the lost samples of each interval. Inserted rows have evenly spaced
times and NaN as angles. All other values are those of the row before the gap, because the rig held
its voltage. The voltage's integral over any interval is unchanged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.logs.sampling_clock import estimate_clock
from heli3dof.recording.recording import Recording

GAP = 1.5
"""Control periods: a longer interval between two rows is a gap."""
HOLE_S = 1.0
"""s: a gap of at least this length is a hole: the log was cut, or the link was down. In shorter
gaps, the rig held its voltage. Chosen, not derived."""


def fill_gaps(recording: Recording, longest: float) -> tuple[Recording, np.ndarray]:
    """Return the recording with inserted rows, and the indices (N,) of the N original rows in it.

    Intervals of more than ``longest`` control periods remain gaps. A recording without missing
    samples is returned unchanged.
    """
    dt, own = recording.dt, np.arange(len(recording))
    n = estimate_clock(recording.t).missing
    n[np.diff(recording.t) > longest * dt] = 0
    if not n.any():
        return recording, own
    before = np.repeat(own, np.append(n, 0) + 1)
    at = own + np.append(0, np.cumsum(n))
    filled = recording.rows(before)
    lost = np.ones(len(before), dtype=bool)
    lost[at] = False
    angle = np.where(lost[:, None], np.nan, filled.angle)
    t = np.interp(np.arange(len(before)), at, recording.t)
    return replace(filled, t=t, angle=angle), at
