"""Find angles that a log holds for several rows.

A program that logs faster than it reads an encoder repeats each reading for m rows. The count then
changes only in every m-th row. Let an axis move by c counts per row, and let g be the number of
rows from one change of its count to the next:

* Read in every row, the count changes by at most ⌈c⌉. Changes of two counts or more need c > 1, and
  then every row has one: g = 1.
* Held for m rows, the count changes by about c m. Changes of two counts or more need c m > 1, and
  are m rows apart: g = m.

So m is the typical g between two successive changes of two counts or more in the same direction,
and no change, however small, follows another much earlier. Slow or still axes change by single
counts and are not tested. A count is the smallest change of the logged angle, and at least the
encoder's step, because a log may print fewer digits.

A late host delays some changes, too, but then the values of g scatter.
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
"""Of held angles, g is within this share of m, and at least within one row of it"""
REGULAR = 0.9
"""Least share of pairs with such a g, and of all changes with a g above m/2"""
HELD_CAUSE = "the program logs faster than it reads the encoders, and repeats each reading."


def rows_held(angle: np.ndarray, step: float) -> float:
    """Return the mean number of rows m for which the log holds a reading; 1 if it holds none.

    ``angle`` (N,), finite, and the encoder's ``step`` have the same unit.
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
    """Return {axis: m} for the axes whose angle (N, 3) rad the log holds for m rows (`rows_held`).

    ``rad_per_count`` (3,): the encoders' steps. Rows with NaN are left out.
    """
    found = {}
    for axis, q, step in zip(AXES, angle.T, rad_per_count, strict=True):
        m = rows_held(q[np.isfinite(q)], float(step))
        if m > 1:
            found[axis] = m
    return found


def held_clause(held: Mapping[str, float], rate_hz: float) -> str:
    """Return the clause that states the rows m of each axis in ``held``.

    ``rate_hz``: the rows' rate.

    >>> held_clause({"roll": 10.0, "pitch": 10.0, "yaw": 3.3}, 1000.0).partition(": ")[2]
    'roll, pitch every 10 rows (100 Hz); yaw every 3.3 rows (303 Hz)'
    """
    axes: dict[str, list[str]] = {}
    for axis, m in held.items():
        axes.setdefault(f"every {m:.2g} rows ({rate_hz / m:.3g} Hz)", []).append(axis)
    return "the angles change in some rows only: " + "; ".join(
        f"{', '.join(names)} {every}" for every, names in axes.items()
    )


def held_fix(held: Mapping[str, float], rate_hz: float) -> str:
    """Return the remedy for the axes in ``held``: the import option that keeps one row of m."""
    return f"import the log with --rate {rate_hz / max(held.values()):.3g}"
