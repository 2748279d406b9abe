"""Convert recordings to arrays for the Kalman filters.

The filters process runs. A run consists of consecutive usable rows (samples) of one recording. The
thrusts at the start of a run depend on earlier voltages, because the rotors lag. So the arrays also
contain a lead-in: the rows of up to `LEAD_S` seconds before the run. The filters use the voltages
of these rows, but not their angles. An axis without measurements does not move in the filters.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.model.estimation.decimated_log import mean_voltage
from heli3dof.recording.gap_filling import GAP as GAP
from heli3dof.recording.recording import Recording
from heli3dof.recording.safety_trip import why_short

LOST = 6.5
"""Sample periods: longest interval with lost or late samples over which the filters predict, with
the last voltage. The error of this prediction costs less accuracy than a restart of the filter."""
LEAD_S = 1.0
"""s, longest lead-in (rows before a run, whose voltages determine the thrusts at its start). Longer
than any rotor's lag."""
CLIMB_S = 0.1
"""s; the climb after take-off ends when roll has not risen for this time."""
ON_TABLE_BELOW = math.radians(-15.0)
"""rad; a rig whose roll starts below this angle counts as at rest on its table. A recording whose
roll is never below it has no table. Chosen between a rig's rest, about −27°, and flight."""
AT_REST_S = 0.02
"""s; a recording starts on the table if the rig rests there at least this long."""
ENCODER_NOISE = 0.06
"""Standard deviation of the angle at which an encoder's reading changes, in encoder steps. For
readings that are not quantised: their noise, in steps of the profile's encoder."""
ON_GRID = 0.03
"""Encoder steps; a reading this close to a whole step counts as quantised."""


@dataclass(frozen=True)
class RowRange:
    """A run: the rows start … stop − 1 of the recording with the index ``source``."""

    source: int
    start: int
    stop: int


@dataclass(frozen=True, eq=False)
class Data:
    """The input arrays of a Kalman filter: N rows of recordings in B blocks.

    A block contains a run (consecutive usable rows of one recording). The block begins with a
    lead-in: the rows of up to `LEAD_S` seconds before the run. The filter uses only the voltages of
    the lead-in, to compute the thrusts at the start of the run.
    """

    t: np.ndarray
    """(N,) s since the first sample of the recording, plus the recording's time shift."""
    h: np.ndarray
    """(N,) s, time to the next row."""
    V: np.ndarray
    """(N, 2) V, mean motor voltages until the next row."""
    y: np.ndarray
    """(N, 3) rad, encoder readings; NaN where lost and in the lead-in."""
    blocks: np.ndarray
    """(B, 3) int64: first row of the lead-in, first row of the run, row after the run."""
    free: np.ndarray
    """(B, 3) bool: the measured axes, which can move."""
    grid: np.ndarray
    """(B, 3) rad: encoder step; 0 for readings that are missing or not quantised."""
    runs: tuple[RowRange, ...]
    rad_per_count: np.ndarray
    """(3,) rad, positive encoder steps of the first recording's profile."""
    time_shifts: tuple[float, ...] = ()
    """s added to the time of each recording (`with_shifted_time`); () for none."""

    @property
    def recorded_t(self) -> np.ndarray:
        """Return the time (N,) s of each row since its recording's first sample.

        The shifts of `with_shifted_time` are removed.
        """
        return (
            with_shifted_time(self, [-x for x in self.time_shifts]).t
            if self.time_shifts
            else self.t
        )

    @property
    def recorded_rows(self) -> np.ndarray:
        """Return an array (N,): for each of the N rows, its row number in the recording.

        The data contain runs (consecutive usable rows of a recording). Directly before each run,
        they also contain up to `LEAD_S` seconds of further rows, whose voltages determine the
        thrusts at the start of the run. The number of such a further row is −1.
        """
        out = np.full(len(self.t), -1)
        for run, (_, start, stop) in zip(self.runs, self.blocks, strict=True):
            out[start:stop] = np.arange(run.start, run.stop)
        return out

    @property
    def axes(self) -> np.ndarray:
        """Return which axes were measured in at least one run, (3,) bool."""
        return np.asarray(self.free.any(axis=0))


def data_of(recordings: Sequence[Recording], runs: Sequence[RowRange]) -> Data:
    """Return the ``runs`` of usable rows as the input arrays of a Kalman filter.

    The rows of up to `LEAD_S` seconds before each run are included, without their angles: their
    voltages determine the thrusts at the start of the run. If the recording starts on the table, a
    row of zero voltage is inserted first. Raises RecordingError if there are no runs.
    """
    if not runs:
        cause, fix = why_short(
            recordings,
            "the rig never left its table, or the flight was too short.",
            "heli3dof info on the recording; then fly longer: heli3dof run rich",
        )
        raise RecordingError("There are no usable rows to fit.", cause=cause, fix=fix)
    parts: list[tuple[np.ndarray, ...]] = []
    blocks, free, grid = [], [], []
    at = 0
    for run in runs:
        rec = recordings[run.source]
        start = _lead_in_start(rec, run.start)
        rows = slice(start, run.stop)
        t = rec.t[rows]
        h = np.append(np.diff(t), rec.dt)
        typical = rec.profile.dt if abs(rec.dt / rec.profile.dt - 1) < 1e-3 else rec.dt
        h = np.where(np.abs(h - typical) < 2e-3 * typical, typical, h)
        y = rec.angle[rows].copy()
        y[: run.start - start] = np.nan
        v, t = mean_voltage(rec)[rows], rec.elapsed_s[rows]
        if start == 0 and starts_on_table(rec):
            # One row of zero voltage before the first: the rotors start at standstill.
            t, h = np.append(t[0] - h[0], t), np.append(h[0], h)
            v, y = np.vstack([np.zeros(2), v]), np.vstack([np.full(3, np.nan), y])
        parts.append((t, h, v, y))
        n = len(t)
        blocks.append((at, at + n - (run.stop - run.start), at + n))
        at += n
        free.append([not np.isnan(y[:, i]).all() for i in range(3)])
        steps = np.abs(rec.profile.encoder.rad_per_count)
        grid.append([q if _on_grid(y[:, i], q) else 0.0 for i, q in enumerate(steps)])
    t, h, V, y = (np.ascontiguousarray(np.concatenate(c)) for c in zip(*parts, strict=True))
    return Data(
        t, h, V, y,
        np.array(blocks, dtype=np.int64),
        np.array(free, dtype=bool),
        np.array(grid, dtype=float),
        tuple(runs),
        np.abs(recordings[0].profile.encoder.rad_per_count),
    )  # fmt: skip


def with_shifted_time(data: Data, time_shifts: Sequence[float]) -> Data:
    """Return the data with ``time_shifts[i]`` (s) added to the time of recording i.

    With suitable shifts, a periodic torque has the same phase in all recordings.
    """
    t = data.t.copy()
    for run, (first, _, stop) in zip(data.runs, data.blocks, strict=True):
        t[first:stop] += time_shifts[run.source]
    return replace(data, t=t, time_shifts=tuple(time_shifts))


def encoder_noise(data: Data, steps: float = ENCODER_NOISE) -> np.ndarray:
    """Return the variance (3,) rad² of encoder noise whose σ is ``steps`` encoder steps."""
    return np.asarray((steps * data.rad_per_count) ** 2)


def starts_on_table(recording: Recording) -> bool:
    """Return True if the rig rests on its table in the first rows; its rotors then stand still."""
    roll = recording.angle[:, 0]
    if np.isnan(roll[0]) or not roll[0] < ON_TABLE_BELOW:
        return False
    near = 2.5 * abs(recording.profile.encoder.rad_per_count[0])
    first = recording.t < recording.t[0] + AT_REST_S
    return bool(roll[0] <= np.nanmin(roll) + near and np.ptp(roll[first]) <= near)


def climb_rows(roll: np.ndarray, rest: float, dt: float) -> int:
    """Return the number of rows from lift-off (row 0) to the end of the initial climb.

    ``roll`` (N,) rad is sampled every ``dt`` s; ``rest`` is the negative roll angle on the table
    (rad). The climb ends when roll is above half of ``rest`` and has not risen for `CLIMB_S`. In
    the climb, rotors spin up and time stamps are least accurate.
    """
    ahead = max(1, round(CLIMB_S / dt))
    later = roll[np.minimum(np.arange(len(roll)) + ahead, len(roll) - 1)]
    done = np.flatnonzero((later <= roll) & (roll > 0.5 * rest))
    return min(int(done[0]) + ahead, len(roll)) if len(done) else len(roll)


def hold_last(
    voltage: np.ndarray, before: np.ndarray | tuple[float, float] = (0.0, 0.0)
) -> np.ndarray:
    """Return ``voltage`` (N, 2) V with each NaN replaced by the last valid value before it.

    Before the first valid value, NaN is replaced by ``before`` (2,) V.
    """
    v = np.array(voltage, dtype=float, order="C")
    for j in range(v.shape[1]):
        good = np.isfinite(v[:, j])
        index = np.maximum.accumulate(np.where(good, np.arange(len(v)), -1))
        v[:, j] = np.where(index >= 0, v[index, j], before[j])
    return v


def _lead_in_start(recording: Recording, start: int) -> int:
    """Return the first row of the lead-in, the rows directly before row ``start``.

    The filter starts in row ``start``. The voltages of the lead-in determine the thrusts in that
    row. The lead-in is at most `LEAD_S` seconds long. It contains no interval longer than `LOST`
    sample periods and no row with an unknown voltage (NaN).
    """
    dt = recording.dt
    first = max(0, start - round(LEAD_S / dt))
    t, v = recording.t[first : start + 1], recording.voltage[first : start + 1]
    broken = np.flatnonzero(np.diff(t) > LOST * dt)
    lost = np.flatnonzero(np.isnan(v).any(axis=1))
    skip = max(broken[-1] + 1 if len(broken) else 0, lost[-1] + 1 if len(lost) else 0)
    return min(start, first + int(skip))


def _on_grid(y: np.ndarray, step: float) -> bool:
    """Return True if over 98 % of the angles y are a whole number of steps from the first one.

    ``step`` (rad) is the encoder step. Deviations below `ON_GRID` steps count as zero.
    """
    y = y[np.isfinite(y)]
    if not len(y):
        return False
    counts = (y - y[0]) / step
    return bool((np.abs(counts - np.round(counts)) < ON_GRID).mean() > 0.98)
