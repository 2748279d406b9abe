"""Lost samples given their rows back, so that what counts rows counts periods.

Between t[k] and t[k+1] are missing

    n = round((t[k+1] − t[k]) / dt) − 1        samples

and one less for a sample that came late, so that the next one follows early. They get times spread
evenly, no angles (NaN), and what the recording says was held meanwhile: the last voltage (its
integral over any interval stays what it was), the last reference, the last extra voltage.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.recording import Recording

GAP = 1.5
"""Periods: a longer interval between two rows is a gap."""
EARLY = 0.5
"""Of the period: a step shorter than that follows a late sample."""


def missing(t: np.ndarray, dt: float) -> np.ndarray:
    """(N − 1,) how many samples are missing in each step of a clock with the period ``dt`` (s)."""
    d = np.diff(t)
    after = np.append(d[1:], dt)
    late = np.where(after < EARLY * dt, np.clip(dt - after, 0.0, d - dt), 0.0)
    return np.asarray(np.maximum(np.round((d - late) / dt).astype(int) - 1, 0))


def bridged(recording: Recording, longest: float) -> tuple[Recording, np.ndarray]:
    """The recording with rows for what is missing, and where its own N rows are in it.

    A step of more than ``longest`` periods stays as it is: a gap. Where nothing is missing the
    recording itself is returned.
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
