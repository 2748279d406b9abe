"""Select the rows of a flight to which a linear model can be fitted; give a reason for the others.

A linear model about hover does not describe the rig on its table, at a stop, in take-off, or in
free fall. Roll is the elevation angle of the arm. It is negative on the table and zero when the arm
is level. Rows are left out for one of these reasons:

``unread``        a NaN in a voltage or an angle
``table``         roll at most 1° above its angle on the table, for 0.1 s or more
``take_off``      from lift-off until all three hold: roll is above half of its angle on the table,
                  the voltages have been off their limit for 0.25 s, and 3 s have passed
``stop``          roll or pitch at a mechanical stop, as defined below
``motors_off``    both voltages zero for 0.1 s or more, and the rows after that until roll rises
``falling``       at the end of a flight: the rows after the last one in which roll is above half of
                  its angle on the table
``ramp_down``     the ramp of the voltages to zero that ends a flight (channel ``phase``)

**Stops.** Roll has an upper stop, and pitch has two stops. Yaw has none. An axis is at a stop while
its encoder count is constant, if all of these hold:

- The angle is within 0.2° of the axis' largest or smallest angle in the flight.
- This largest or smallest angle is beyond ±25°.
- The count is constant for 0.3 s or more, or the axis has hit the stop.

A test distinguishes an axis that has hit a stop from an axis that only reverses. Let q be the width
of an encoder count. The axis arrives at the rate v and stays on one count for the time T. If it
reverses within this count with the constant acceleration a, then v = √(2qa) and T = 2 √(2q/a), so
v T = 4q. An axis at a stop stays longer:

    v T > `HIT` q

The test misses an impact if the axis leaves the stop sooner. A missed impact would harm a fit: the
Kalman filter's model has no stops, so the filter would treat the impact as process noise. But a
stop has a fixed angle. So if the test finds a row at a stop, all rows of the flight in which this
encoder has the same count are left out.

**Saturation.** Rows in flight with a voltage at its limit are kept, because the recorded voltage is
the voltage at the motor. Their share is reported.
"""

from __future__ import annotations

import itertools

import numpy as np

from heli3dof.axes import AXES, ROLL, YAW
from heli3dof.model.estimation.filter_data import LOST, ON_TABLE_BELOW, RowRange, climb_rows
from heli3dof.recording.recording import Recording

REASONS = ("unread", "table", "take_off", "stop", "motors_off", "falling", "ramp_down")
NEAR_TABLE = np.deg2rad(1.0)
STOP_BEYOND = np.deg2rad(25.0)
SETTLED_S = 0.25
TAKE_OFF_S = 3.0
STILL_S = 0.1
LEAST_RUN_S = 0.5
"""s: shortest run of usable rows to which a grey-box model is fitted. Chosen; not derived."""
AT_STOP_S = 0.3
AT_EXTREME = np.deg2rad(0.2)
HIT = 8.0
BEFORE_S = 0.01
"""Time in s over which the rate v before an impact is measured"""


def clipped(recording: Recording) -> np.ndarray:
    """Return (N,) bool: rows with a voltage of at least 99.9 % of the amplifier's limit."""
    limit = recording.profile.motor.v_max * 0.999
    return np.asarray((np.abs(recording.voltage) >= limit).any(axis=1))


def unusable(recording: Recording) -> dict[str, np.ndarray]:
    """Return {reason: mask (N,) bool of the rows to leave out}; a row can have several reasons."""
    v, y = recording.voltage, recording.angle
    measured = [i for i, a in enumerate(AXES) if a in recording.axes]
    rows: dict[str, np.ndarray] = {r: np.zeros(len(recording), dtype=bool) for r in REASONS}
    rows["unread"] = np.asarray(np.isnan(np.column_stack([v, y[:, measured]])).any(axis=1))
    still = max(2, round(STILL_S / recording.dt))
    rows["motors_off"] = _long_runs(np.asarray((np.abs(v) <= 1e-9).all(axis=1)), still)
    if ROLL in measured:
        roll = y[:, ROLL]
        rows["table"], rows["take_off"] = _table(recording)
        rows["motors_off"] = _until_roll_rises(rows["motors_off"], roll)
        rows["falling"] = _falling(roll)
    for i in (i for i in measured if i != YAW):
        # The lower stop of roll is the table, which has its own reason.
        above = y[:, i] if i != ROLL else np.maximum(y[:, i], 0.0)
        rows["stop"] |= _at_stop(above, recording.dt)
    if "phase" in recording.channels:
        rows["ramp_down"] = np.asarray(recording.channels["phase"]) >= 1
    return rows


def rows_in_flight(recording: Recording) -> np.ndarray:
    """Return (N,) bool: True for the rows to which a rigid-body model applies.

    A row is False while the rig is on its table, at a mechanical stop, falling, or without motor
    voltage, and while the voltages ramp down to zero. After take-off, rows are True from the end of
    the climb on. For a linear model, rows are usable only some seconds later (`unusable`).
    """
    masks = unusable(recording)
    bad = np.logical_or.reduce([m for k, m in masks.items() if k not in ("unread", "take_off")])
    roll = recording.angle[:, ROLL]
    for a, b in stretches(masks["take_off"]):
        bad[a : a + climb_rows(roll[a:b], float(np.nanmin(roll)), recording.dt)] = True
    return np.asarray(~bad)


def _table(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return two masks (N,) bool of a recording's rows: on the table, and in take-off."""
    roll = np.nan_to_num(recording.angle[:, ROLL], nan=0.0)
    rest = float(roll.min())
    n = len(roll)
    none = np.zeros(n, dtype=bool)
    if rest > ON_TABLE_BELOW:
        return none, none
    table = roll <= rest + NEAR_TABLE
    # The arm must rest on the table: the lowest point of a flight does not count as the table.
    table = _long_runs(table, max(2, round(STILL_S / recording.dt)))
    limit = clipped(recording)
    settled = max(1, round(SETTLED_S / recording.dt))
    least = round(TAKE_OFF_S / recording.dt)
    take_off = none.copy()
    for lift in np.flatnonzero(table[:-1] & ~table[1:]) + 1:
        k = int(lift)
        calm = 0
        while k < n and not table[k]:
            calm = 0 if limit[k] else calm + 1
            if roll[k] > rest / 2 and calm >= settled and k >= lift + least:
                break
            k += 1
        take_off[lift:k] = True
    return table, take_off


def _until_roll_rises(motors_off: np.ndarray, roll: np.ndarray) -> np.ndarray:
    """Return (N,) bool: the rows with ``motors_off``, and those after them until ``roll`` rises.

    ``motors_off`` (N,) bool marks the rows in which both motor voltages are zero. When the motors
    start again, the arm still moves down for some time.
    """
    out = motors_off.copy()
    for end in np.flatnonzero(motors_off[:-1] & ~motors_off[1:]) + 1:
        k = int(end)
        while k < len(roll) - 1 and roll[k + 1] <= roll[k]:
            out[k] = True
            k += 1
    return out


def _falling(roll: np.ndarray) -> np.ndarray:
    """Return (N,) bool: the rows of the last descent, towards the table.

    The descent begins where ``roll`` (N,) rad was last above half of its (negative) first value. If
    the recording does not start on the table, no row is True.
    """
    out = np.zeros(len(roll), dtype=bool)
    if roll[0] < ON_TABLE_BELOW:
        up = np.flatnonzero(roll > roll[0] / 2)
        if len(up):
            out[up[-1] + 1 :] = True
    return out


def _at_stop(angle: np.ndarray, dt: float) -> np.ndarray:
    """Return (N,) bool: rows of ``angle`` (N,) rad at a mechanical stop, sampled every ``dt`` s."""
    out = np.zeros(len(angle), dtype=bool)
    moves = np.abs(np.diff(angle))
    edges = np.concatenate([[0], np.flatnonzero(moves != 0) + 1, [len(angle)]])
    first, rest_s = edges[:-1], np.diff(edges) * dt
    counts = moves[moves > 0]
    width = float(counts.min()) if len(counts) else np.inf
    back = max(1, round(BEFORE_S / dt))
    fast = np.abs(angle[first] - angle[np.maximum(first - back, 0)]) / (back * dt)
    for k in np.flatnonzero((rest_s >= AT_STOP_S) | (fast * rest_s > HIT * width)):
        out[edges[k] : edges[k + 1]] = True
    with np.errstate(invalid="ignore"):
        extremes = [x for x in (np.nanmax(angle), np.nanmin(angle)) if abs(x) > STOP_BEYOND]
        near = [np.abs(angle - x) <= AT_EXTREME for x in extremes]
    if not near:
        return np.zeros_like(out)
    hit = out & np.logical_or.reduce(near)
    return np.asarray(hit | np.isin(angle, np.unique(angle[hit])))


def stretches(mask: np.ndarray, cuts: np.ndarray | None = None) -> list[tuple[int, int]]:
    """Return (first row, row after the last) of each run of True in a mask (N,).

    The runs are also split before the rows ``cuts``.
    """
    edges = np.flatnonzero(np.diff(mask)) + 1
    edges = np.unique(np.concatenate([[0, len(mask)], edges, [] if cuts is None else cuts]))
    return [(a, b) for a, b in itertools.pairwise(edges.astype(int).tolist()) if mask[a]]


def runs_of(
    ok: np.ndarray, recording: Recording, source: int, longest_gap_s: float, least: float
) -> list[RowRange]:
    """Return the runs of rows that are ``ok`` (N,) bool, each at least ``least`` rows long.

    A run ends at a gap of more than ``longest_gap_s`` s. ``source`` is the recording's index.
    """
    breaks = np.flatnonzero(np.diff(recording.t) > longest_gap_s) + 1
    return [RowRange(source, a, b) for a, b in stretches(ok, breaks) if b - a >= least]


def usable_runs(recording: Recording, source: int) -> list[RowRange]:
    """Return the runs of usable rows of a recording, each at least `LEAST_RUN_S` s long.

    A run ends at a gap of more than `LOST` periods. ``source`` is the recording's index.
    """
    bad = np.logical_or.reduce(list(unusable(recording).values()))
    least = LEAST_RUN_S / recording.dt
    return runs_of(~bad, recording, source, LOST * recording.dt, least)


def _long_runs(mask: np.ndarray, at_least: int) -> np.ndarray:
    """Return the mask (N,) without its runs of True that are shorter than ``at_least`` rows."""
    out = np.zeros(len(mask), dtype=bool)
    for a, b in stretches(mask):
        if b - a >= at_least:
            out[a:b] = True
    return out
