"""A log that holds every m-th sample of its loop only: what the motors got until its next row.

In a step of the log the loop puts out m voltages. The first is logged, and so is the one that comes
after the last; on the line between, v_j = v_0 + (j/m) (v_m − v_0), j = 0 … m − 1, and their mean is

    v̄ = v_0 + (m − 1)/(2m) (v_m − v_0)

v_0 alone would have every voltage come (m − 1)/2 periods early: an effective delay that the rig has
not, which in a loop looks like friction. What the voltages did beside the line is not known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.recording import Recording

NEAR = 0.02
"""A share of m, by which a log's step may differ from m periods of its profile's loop."""
GAP = 1.5
"""Steps: over a longer one there is no line."""


def thinning(recording: Recording) -> int:
    """m; 1 where the log is as fast as its loop, or its rate is no part of it."""
    if len(recording) < 2:
        return 1
    ratio = recording.dt / recording.profile.dt
    m = round(ratio)
    return m if m > 1 and abs(ratio - m) < NEAR * m else 1


def mean_voltage(recording: Recording) -> np.ndarray:
    """(N, 2) V: v̄ from each row to the next. The last row's, and one before a gap, is its own."""
    m, v = thinning(recording), recording.voltage
    if m == 1:
        return v
    share = np.where(np.diff(recording.t) < GAP * recording.dt, (m - 1) / (2 * m), 0.0)
    rise = np.nan_to_num(np.diff(v, axis=0))
    return np.vstack([v[:-1] + share[:, None] * rise, v[-1:]])


def filled(recording: Recording) -> tuple[Recording, np.ndarray]:
    """A row for every period of the loop, and where the N rows of the log are among them.

    References are held, extra voltages lie on the line between the log's; angles and voltages, of
    which nothing is known between the rows, are held too, to be flown anew.
    """
    own = np.arange(len(recording))
    if thinning(recording) == 1:
        return recording, own
    n = np.maximum(np.round(np.diff(recording.t) / recording.profile.dt).astype(int), 1)
    at = np.append(0, np.cumsum(n))
    rows = np.arange(at[-1] + 1)
    whole = recording.rows(np.repeat(own, np.append(n, 1)))
    extra = np.column_stack([np.interp(rows, at, e) for e in recording.voltage_extra.T])
    return replace(whole, t=np.interp(rows, at, recording.t), voltage_extra=extra), at
