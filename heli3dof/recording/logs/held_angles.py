"""Find the angles whose encoder readings a log repeats in several successive rows.

A program that logs faster than it reads an encoder repeats each reading in m rows (sample and
hold). The logged angle then changes only in every m-th row. In this module, one count is the
smallest change of the logged angle, but at least the encoder's step. The smallest change exceeds
the step if the log prints few digits.

Let an axis move by c counts per row, and let g be the number of rows from one change of its count
to the next:

* If the program reads the encoder for every row, the count changes by at most ⌈c⌉. Changes of two
  counts or more need c > 1. Then the count changes in every row: g = 1.
* If the program reads the encoder for every m-th row, the count changes by about c m. Changes of
  two counts or more need c m > 1. Then the count changes in every m-th row: g = m.

The estimate of m is the typical g between two successive changes of two counts or more in the same
direction. The readings count as repeated only if two more conditions hold. Most of these g must be
close to m. And most changes, even changes of one count, must follow the previous change after more
than m/2 rows. If the host is late, it delays some changes, too, but then the values of g scatter.

The module cannot test a slow axis, because its angle changes by single counts only.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from heli3dof.axes import AXES

FAST = 1.5
"""counts: a larger change is one of two counts or more, whatever the rounding"""
LEAST = 20
"""Least number of pairs of such changes that is tested. Chosen, as are the constants below: real
logs of three rigs have g = 1, or at most three pairs."""
NEAR = 0.2
"""g is close to m if it differs by at most this share of m, or by one row"""
REGULAR = 0.9
"""Least share of the pairs with a g close to m; least share of all changes with a g above m/2"""
HELD_CAUSE = "the program logs faster than it reads the encoders, and repeats each reading."


def rows_per_reading(angle: np.ndarray, step: float) -> float:
    """Return the mean number of successive rows in which the log repeats each encoder reading.

    The result is 1 if the log does not repeat readings regularly. ``angle`` (N,): finite angles;
    ``step``: the encoder's step in the same unit.
    """
    change = np.diff(angle)
    rows = np.flatnonzero(change)
    if len(rows) <= LEAST:
        return 1.0
    counts = change[rows] / max(abs(step), np.abs(change[rows]).min())
    fast = np.abs(counts) > FAST
    pairs = fast[1:] & fast[:-1] & (counts[1:] * counts[:-1] > 0)
    spacing = np.diff(rows)
    g = spacing[pairs]
    if len(g) < LEAST:
        return 1.0
    m = float(np.median(g))
    regular = np.abs(g - m) <= max(1.0, NEAR * m)
    if m < 2 or min(regular.mean(), (spacing > m / 2).mean()) < REGULAR:
        return 1.0
    return float(g[regular].mean())


def held_axes(angle: np.ndarray, rad_per_count: np.ndarray) -> dict[str, float]:
    """Return {axis: m} for each axis whose readings the log repeats in m > 1 rows on average.

    ``angle`` (N, 3): angles in rad; rows with NaN are left out. ``rad_per_count`` (3,): the
    encoders' steps. `rows_per_reading` estimates m.
    """
    found = {}
    for axis, q, step in zip(AXES, angle.T, rad_per_count, strict=True):
        m = rows_per_reading(q[np.isfinite(q)], float(step))
        if m > 1:
            found[axis] = m
    return found


def held_angles_clause(held: Mapping[str, float], rate_hz: float) -> str:
    """Return the clause that states after how many rows the angle of each axis changes.

    ``held``: {axis: number of rows in which the log repeats each reading}; ``rate_hz``: rate of the
    log's rows.

    >>> held_angles_clause({"roll": 10.0, "pitch": 10.0, "yaw": 3.3}, 1000.0).partition(": ")[2]
    'roll, pitch every 10 rows (100 Hz); yaw every 3.3 rows (303 Hz)'
    """
    axes: dict[str, list[str]] = {}
    for axis, m in held.items():
        axes.setdefault(f"every {m:.2g} rows ({rate_hz / m:.3g} Hz)", []).append(axis)
    return "the angles change in some rows only: " + "; ".join(
        f"{', '.join(names)} {every}" for every, names in axes.items()
    )


def one_row_per_reading(held: Mapping[str, float], rate_hz: float) -> str:
    """Return the remedy for a log that repeats readings: an import with one row per reading.

    ``held``: {axis: number of rows in which the log repeats each reading}; the largest number is
    used. ``rate_hz``: rate of the log's rows.
    """
    return f"import the log with --rate {rate_hz / max(held.values()):.3g}"
