"""Logs that hold every m-th sample of their control loop: the motors' mean voltage between rows.

Between two rows the loop outputs m voltages. The first is logged, and so is the one after the last.
With linear interpolation, v_j = v_0 + (j/m) (v_m − v_0), j = 0 … m − 1, their mean is

    v̄ = v_0 + (m − 1)/(2m) (v_m − v_0)

Using v_0 alone would advance the voltages by (m − 1)/2 periods: an apparent delay that the rig does
not have and that looks like friction in closed loop.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.recording.gap_filling import GAP
from heli3dof.recording.recording import Recording

NEAR = 0.02
"""Largest relative difference between a log's interval and m periods of its profile's loop."""


def decimation(recording: Recording) -> int:
    """m; 1 for a log at the loop rate, or at no integer fraction of it."""
    if len(recording) < 2:
        return 1
    ratio = recording.dt / recording.profile.dt
    m = round(ratio)
    return m if m > 1 and abs(ratio - m) < NEAR * m else 1


def mean_voltage(recording: Recording) -> np.ndarray:
    """(N, 2) V: v̄ from each row to the next; v_0 in the last row and before a gap."""
    m, v = decimation(recording), recording.voltage
    if m == 1:
        return v
    share = np.where(np.diff(recording.t) < GAP * recording.dt, (m - 1) / (2 * m), 0.0)
    rise = np.nan_to_num(np.diff(v, axis=0))
    return np.vstack([v[:-1] + share[:, None] * rise, v[-1:]])


def with_loop_rows(recording: Recording) -> tuple[Recording, np.ndarray]:
    """(recording with a row for every period of the loop, (N,) index of the log's rows in it).

    References are held and extra voltages interpolated linearly. Angles and voltages are unknown
    between the rows and held as placeholders; the caller simulates them.
    """
    own = np.arange(len(recording))
    if decimation(recording) == 1:
        return recording, own
    n = np.maximum(np.round(np.diff(recording.t) / recording.profile.dt).astype(int), 1)
    at = np.append(0, np.cumsum(n))
    rows = np.arange(at[-1] + 1)
    whole = recording.rows(np.repeat(own, np.append(n, 1)))
    extra = np.column_stack([np.interp(rows, at, e) for e in recording.voltage_extra.T])
    return replace(whole, t=np.interp(rows, at, recording.t), voltage_extra=extra), at
