"""Reduce the rate of a log: keep some rows, and average each voltage from one kept row to the next.

In the log, the voltage of row k acts until row k + 1. A model of the kept rows assumes a constant
voltage from one kept row i to the next one j. The mean voltage of the rows i … j − 1 has the same
integral. All other signals are not averaged.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from heli3dof.axes import AXES
from heli3dof.errors import UsageError
from heli3dof.recording.logs.held_angles import rows_per_reading
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.log_validation import check_time_increases
from heli3dof.rig.log_columns import ANGLE_UNITS, VOLTAGE_COLUMNS
from heli3dof.rig.profile import Profile

SAME = 0.01
"""Largest relative difference of two rates, or spacings of rows, that count as equal. Chosen."""
SAME_READING = 0.1
"""Largest difference of m/m_held from a whole number. m: rows of the log per kept row; m_held:
number of successive rows in which the log repeats a reading. The estimate of m_held is accurate to
a few per cent. Chosen."""
MEANS = "with the mean of each voltage over the interval to the next one."


def at_rate(table: Table, profile: Profile, rate_hz: float) -> Table:
    """Return ``table`` with about ``rate_hz`` rows per second.

    The function keeps some rows of the log. The voltage of a kept row is the mean from this row to
    the next kept row. The log's rate must be a whole multiple of ``rate_hz``.

    A log may repeat each reading of an angle in several rows (`rows_per_reading`). If ``rate_hz``
    is at most the rate of these readings, that rate must be a whole multiple of ``rate_hz``
    instead. The function then keeps rows in which the angle changes. The number of rows between two
    kept rows may alternate, for example 3, 3, 4. In this case the kept rows get evenly spaced
    times.

    Raises UsageError for other rates, RecordingError if time does not increase.
    """
    t = table.columns["t_s"]
    check_time_increases(table.source, t, table.where)
    m = 1 / (rate_hz * float(np.median(np.diff(t))))
    if m < 1 - SAME:
        raise UsageError(
            f"--rate {rate_hz:g} exceeds the log's rate, {rate_hz * m:.4g} Hz.",
            cause="a typing error, or another log.",
            fix="a lower rate, or no --rate",
        )
    if m < 1 + SAME:
        return table
    changes, held = [np.zeros(0, dtype=int)], 1.0
    for axis, step in zip(AXES, profile.encoder.rad_per_count, strict=True):
        for unit, factor in ANGLE_UNITS.items():
            angle = np.nan_to_num(table.columns.get(f"{axis}_{unit}", np.zeros(1)))
            rows_of_reading = rows_per_reading(angle, float(step) / factor)
            if rows_of_reading > 1:
                changes.append(np.flatnonzero(np.diff(angle)) + 1)
                held = max(held, rows_of_reading)
    readings = m / held
    keeps_readings = held > 1 and readings > 1 - SAME_READING
    if keeps_readings and abs(readings - round(readings)) < SAME_READING:
        rows = _rows_to_keep(np.unique(np.concatenate(changes)), m, len(t))
    elif not keeps_readings and abs(round(m) / m - 1) < SAME:
        rows = np.arange(0, len(t), round(m))
    else:
        raise _no_multiple(rate_hz, m, held)
    columns = {
        name: interval_means(values, rows) if name in VOLTAGE_COLUMNS else values[rows]
        for name, values in table.columns.items()
    }
    steps = np.diff(rows)
    if len(steps) and abs(np.median(steps) / steps.mean() - 1) > SAME:
        even = np.linspace(rows[0], rows[-1], len(rows))
        columns["t_s"] = np.interp(even, np.arange(len(t)), t)
    note = f"{len(rows)} of {len(t)} rows are kept (--rate {rate_hz:g}), {MEANS}"
    where = table.where
    return replace(
        table, columns=columns, where=lambda k: where(int(rows[k])), notes=[*table.notes, note]
    )


def _no_multiple(rate_hz: float, m: float, held: float) -> UsageError:
    """Return the UsageError for a log whose rate is not a whole multiple of ``rate_hz``.

    ``m``: the log's rate divided by ``rate_hz``. ``held``: number of successive rows in which the
    log repeats each encoder reading. If ``held`` exceeds 1, the message states the rate of these
    readings instead of the log's rate. The error suggests the nearest usable rates.
    """
    log_hz = rate_hz * m / held
    below = int(m / held)
    usable = [f"--rate {log_hz / n:.4g}" for n in (below, below + 1) if n * held > 1 + SAME]
    what = "the log's rate" if held == 1 else "the rate of the log's readings"
    return UsageError(
        f"--rate {rate_hz:g}: {what}, {log_hz:.4g} Hz, is not a whole multiple of it.",
        cause="the rows that are nearest to this rate are not evenly spaced.",
        fix=" or ".join(usable),
    )


def with_mean_voltages(table: Table) -> Table:
    """Replace sampled voltages by their means (`Table.means`), if known; return the new table.

    Each mean is over the interval from one row to the next. The means of a voltage are known if
    several logs were joined, and the voltage's log has more rows per second than the joined table.
    All other voltages remain sampled values.
    """
    sources = {name: table.origins.get(name, name) for name in VOLTAGE_COLUMNS}
    means = {n: table.means[s] for n, s in sources.items() if s in table.means}
    voltages = {n: values for n, values in means.items() if n in table.columns}
    return replace(table, columns={**table.columns, **voltages})


def _rows_to_keep(changes: np.ndarray, m: float, n: int) -> np.ndarray:
    """Return the indices of the rows to keep of a log with ``n`` rows: about every ``m``-th row.

    ``changes``: increasing indices of the rows in which an angle changes. A row is due ``m`` rows
    after the previous kept row. If a row in ``changes`` is less than m/2 rows away from the due
    row, the nearest such row is kept instead.
    """
    rows: list[int] = []
    due = max((float(changes[0]) + 0.5) % m - 0.5, 0.0) if len(changes) else 0.0
    while due < n - 0.5:
        k = int(np.searchsorted(changes, due))
        near = min(changes[max(k - 1, 0) : k + 1], key=lambda row: abs(row - due), default=-np.inf)
        if abs(near - due) < m / 2:
            due = float(near)
        rows.append(round(due))
        due += m
    return np.unique(rows)


def interval_means(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the mean of ``values`` (N,) over each of n successive intervals of rows.

    ``rows`` (n,): increasing indices of the rows at which the intervals start. Each interval ends
    before the next one starts. The last interval has as many rows as the interval before it, or
    fewer if ``values`` ends earlier.
    """
    last = int(rows[-1]) + (int(rows[-1] - rows[-2]) if len(rows) > 1 else 1)
    stop = min(last, len(values))
    return np.add.reduceat(values[:stop], rows) / np.diff(rows, append=stop)
