"""Insert rows for lost samples, so that one row is one control period.

With the control period dt, the number of samples missing between the times t[k] and t[k+1] is

    n = max(0, round((t[k+1] − t[k] − δ) / dt) − 1)

δ is the delay of sample k+1, estimated from the next interval, t[k+2] − t[k+1]. If this interval is
shorter than `EARLY` dt, δ is dt minus the interval, but at most t[k+1] − t[k] − dt. Otherwise
δ = 0. Inserted rows have evenly spaced times and NaN as angles. All other values are those of row
k, because the rig held its voltage. The voltage's integral over any interval is unchanged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.recording import Recording

GAP = 1.5
"""Control periods: a longer interval between two rows is a gap."""
EARLY = 0.5
"""Share of the control period: an interval below it means that its first sample was late."""


def missing(t: np.ndarray, dt: float) -> np.ndarray:
    """Return how many samples are missing in each interval (N − 1,) between times ``t`` (N,).

    ``t`` and the control period ``dt`` are in s.
    """
    d = np.diff(t)
    after = np.append(d[1:], dt)
    late = np.where(after < EARLY * dt, np.clip(dt - after, 0.0, d - dt), 0.0)
    return np.asarray(np.maximum(np.round((d - late) / dt).astype(int) - 1, 0))


def fill_gaps(recording: Recording, longest: float) -> tuple[Recording, np.ndarray]:
    """Return the recording with inserted rows, and the indices (N,) of the N original rows in it.

    Intervals of more than ``longest`` control periods remain gaps. A recording without missing
    samples is returned unchanged.
    """
    dt, own = recording.dt, np.arange(len(recording))
    n = missing(recording.t, dt)
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
