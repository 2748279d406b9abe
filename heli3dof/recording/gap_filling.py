"""Insert rows for lost samples, so that one row is one control period.

Between t[k] and t[k+1] are

    n = round((t[k+1] − t[k]) / dt) − 1        missing samples

and one less if sample k+1 was late, so that the next interval is short. Inserted rows have evenly
spaced times, no angles (NaN), and the last voltage, reference and extra voltage, which the rig
held. The voltage's integral over any interval is unchanged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.recording import Recording

GAP = 1.5
"""Periods: a longer interval between two rows is a gap."""
EARLY = 0.5
"""Share of the period; a shorter interval follows a late sample."""


def missing(t: np.ndarray, dt: float) -> np.ndarray:
    """(N − 1,) number of missing samples in each interval of times (N,) s; period ``dt`` in s."""
    d = np.diff(t)
    after = np.append(d[1:], dt)
    late = np.where(after < EARLY * dt, np.clip(dt - after, 0.0, d - dt), 0.0)
    return np.asarray(np.maximum(np.round((d - late) / dt).astype(int) - 1, 0))


def fill_gaps(recording: Recording, longest: float) -> tuple[Recording, np.ndarray]:
    """The recording with inserted rows, and the indices (N,) of its own rows in it.

    Intervals of more than ``longest`` periods remain gaps. Without missing samples the recording
    itself is returned.
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
