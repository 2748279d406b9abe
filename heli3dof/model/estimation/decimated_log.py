"""Handle logs that contain every m-th sample of their control loop (decimated logs).

From one row to the next the loop outputs m voltages v_0 … v_{m−1}. The log contains v_0 and, in the
next row, v_m. With linear interpolation, v_j = v_0 + (j/m) (v_m − v_0), the mean voltage is

    v̄ = v_0 + (m − 1)/(2m) (v_m − v_0)

Using v_0 alone would delay the voltages by (m − 1)/2 periods on average. A fit would explain this
by too small a rotor lag, or in closed loop by friction that the rig does not have.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from heli3dof.recording.gap_filling import GAP, HOLE_S
from heli3dof.recording.recording import Recording

NEAR = 0.02
"""Largest relative difference between a decimated log's sample interval and m control periods."""


def decimation(recording: Recording) -> int:
    """Return m, the sample interval in control periods; 1 if the ratio is not nearly whole."""
    if len(recording) < 2:
        return 1
    ratio = recording.dt / recording.profile.dt
    m = round(ratio)
    return m if m > 1 and abs(ratio - m) < NEAR * m else 1


def mean_voltage(recording: Recording) -> np.ndarray:
    """Return the mean motor voltage v̄ (N, 2) V from each row of the log to the next.

    Equation: see the head of this file. In the last row and before a gap, v̄ is the logged voltage.
    """
    m, v = decimation(recording), recording.voltage
    if m == 1:
        return v
    share = np.where(np.diff(recording.t) < GAP * recording.dt, (m - 1) / (2 * m), 0.0)
    rise = np.nan_to_num(np.diff(v, axis=0))
    return np.vstack([v[:-1] + share[:, None] * rise, v[-1:]])


def with_loop_rows(
    recording: Recording, changes: Mapping[int, float] | None = None
) -> tuple[Recording, np.ndarray]:
    """Return the log with a row per control period, and the indices (N,) of the N logged rows.

    If the log is not decimated, rows are added only in gaps of `HOLE_S` or more, in which the
    loop ran but was not logged. In shorter gaps the rig held its voltage.

    In an added row, the time and the excitation (``voltage_extra``) are interpolated. All other
    values, such as the references, are those of the row before. ``changes`` {k: t} states
    exceptions: from the time t (s) on, rows added between rows k and k + 1 have the values of row
    k + 1. The caller can replace the angles and voltages, which are unknown in added rows, by a
    simulation.
    """
    own = np.arange(len(recording))
    step = np.diff(recording.t)
    n = np.maximum(np.round(step / recording.profile.dt).astype(int), 1)
    if decimation(recording) == 1:
        n[step < HOLE_S] = 1
    if (n == 1).all():
        return recording, own
    at = np.append(0, np.cumsum(n))
    rows = np.arange(at[-1] + 1)
    t = np.interp(rows, at, recording.t)
    source = np.repeat(own, np.append(n, 1))
    for k, change_s in (changes or {}).items():
        added = slice(at[k] + 1, at[k + 1])
        source[added] += t[added] >= change_s
    whole = recording.rows(source)
    extra = np.column_stack([np.interp(rows, at, e) for e in recording.voltage_extra.T])
    return replace(whole, t=t, voltage_extra=extra), at
