"""Tracks: a track is the time series of one quantity over the flights of one rig.

A quantity is a column NAME of the batch's results table that has a column ``NAME_std``, or one of
`WITHOUT_STD`. Tracks leave out a recording for one of three reasons:

- its command failed (``exit_code``)
- an integrity check found bad data (``faults``)
- an earlier recording has the same samples (``digest``)

A track also omits flights without a finite value. Unless the quantity is in `WITHOUT_STD`, it omits
flights without a standard deviation > 0.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.arrays import FloatArray
from heli3dof.batch import results_table

STD = "_std"
WITHOUT_STD = ("jitter_s", "lost_share", "late_share")
DIGITS = 12
"""Significant digits of a value; differences beyond them are rounding errors of float64"""
DAY = 86400.0
"""s per day"""
NEEDED = ("recording", "rig", "exit_code")
"""Columns that the results table must have"""
Row = Mapping[str, Any]


@dataclass(frozen=True)
class BadRecording:
    """A recording that is not used, and the reason."""

    recording: str
    rig: str
    reason: str


@dataclass(frozen=True, eq=False)
class Track:
    """Time series of one quantity over n flights of one rig."""

    rig: str
    quantity: str
    t: FloatArray
    """(n,) start times in days since 1970-01-01 UTC; if ``dated`` is False, the numbers 0, 1, 2, …
    of the flights"""
    y: FloatArray
    """(n,) values in the quantity's unit"""
    s: FloatArray | None
    """(n,) standard deviations of ``y``; None for a quantity in `WITHOUT_STD`"""
    plans: np.ndarray
    """(n,) names of the flight plans; empty for a flight without a plan"""
    flights: tuple[str, ...]
    """Names of the recordings"""
    absent: np.ndarray
    """(n,) bool: the fit found no effect, so the value is the one without the effect"""
    dated: bool
    """False if the start of any of the rig's flights is unknown, or if all starts are equal"""

    @property
    def hidden(self) -> FloatArray:
        """Return (n,): the variance of the estimates that the bound of an absent effect hides."""
        return np.zeros_like(self.y) if self.s is None else np.where(self.absent, self.s**2, 0.0)


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of the results table in ``folder``, without those of bootstrap replicates.

    Empty cells become None. Raises UsageError if the table is missing, RecordingError if it is not
    a results table.
    """
    rows = results_table.read_rows(folder, needed=NEEDED)
    return [row for row in rows if not row.get("replicate")]


def with_distinct_rig_names(rows: Sequence[Row]) -> list[Row]:
    """Return the rows, with the rig renamed to ``NAME (SERIAL)`` if several rigs share its name.

    Rows with the same name but different serial numbers belong to different rigs. A row without a
    serial number keeps its name.
    """
    serials: dict[str, set[object]] = {}
    for row in rows:
        serials.setdefault(rig_of(row), set()).add(row.get("serial") or None)
    return [
        {**row, "rig": f"{rig_of(row)} ({row['serial']})"}
        if row.get("serial") and len(serials[rig_of(row)] - {None}) > 1
        else row
        for row in rows
    ]


def usable_and_bad(rows: Sequence[Row]) -> tuple[list[Row], tuple[BadRecording, ...]]:
    """Return the rows of the usable recordings, and the recordings that are not used."""
    usable, bad, first = [], [], dict[str, str]()
    for row in rows:
        recording, reason, digest = str(row["recording"]), _reason(row), row.get("digest")
        if not reason and digest:
            same = first.setdefault(str(digest), recording)
            reason = "" if same == recording else f"the same samples as {same}"
        if reason:
            bad.append(BadRecording(recording, rig_of(row), reason))
        else:
            usable.append(row)
    return usable, tuple(bad)


def main_plan(rows: Sequence[Row]) -> str:
    """Return the name of the flight plan that most rows have.

    Rows without a flight plan count as one plan, with an empty name.
    """
    plans = Counter(map(_plan, sorted(rows, key=_plan)))
    return plans.most_common(1)[0][0] if plans else ""


def _reason(row: Row) -> str:
    if row.get("faults"):
        return str(row["faults"])
    if row.get("exit_code") != 0:
        code = row.get("exit_code")
        stated = f"exit code {code:g}" if isinstance(code, float | int) else "no exit code"
        return f"{stated}: {row['error']}" if row.get("error") else stated
    return ""


def rig_of(row: Row) -> str:
    """Return the rig's name; a dash if the row has none."""
    return str(row.get("rig") or "–")


def quantities_of(rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the quantities with a value in any of the rows, in the order of their columns."""
    columns = dict.fromkeys(column for row in rows for column in row)
    named = [c for c in columns if c in WITHOUT_STD or c + STD in columns]
    return tuple(q for q in named if any(_value(row, q) is not None for row in rows))


def tracks_of(rows: Sequence[Row], quantities: Sequence[str]) -> tuple[Track, ...]:
    """Return the tracks of all rigs, sorted by rig.

    A track is the time series of one quantity over the flights of one rig. A rig has a track of a
    quantity in ``quantities`` if at least one flight of the rig gives a value of this quantity.
    """
    rigs: dict[str, list[Row]] = {}
    for row in rows:
        rigs.setdefault(rig_of(row), []).append(row)
    return tuple(
        track
        for rig in sorted(rigs)
        for ordered, starts in [_in_order(rigs[rig])]
        for quantity in quantities
        if (track := _track(rig, quantity, ordered, starts)) is not None
    )


def _in_order(rows: Sequence[Row]) -> tuple[list[Row], list[float] | None]:
    """Return the rows in order of time, and their starts in days since 1970-01-01 UTC.

    If the start of a row is missing, or all rows have the same start, the rows are in the order of
    their names. The starts are then None.
    """
    named = sorted(rows, key=_name)
    starts = [t for row in named if (t := _start(row.get("started_utc"))) is not None]
    if len(starts) < len(named) or (len(named) > 1 and len(set(starts)) == 1):
        return named, None
    order = np.argsort(starts, kind="stable")
    return [named[i] for i in order], [starts[i] for i in order]


def _start(text: object) -> float | None:
    try:
        start = datetime.fromisoformat(str(text))
    except ValueError:
        return None
    return (start if start.tzinfo else start.replace(tzinfo=UTC)).timestamp() / DAY


def _name(row: Row) -> str:
    return str(row.get("name") or row["recording"])


def _plan(row: Row) -> str:
    return str(row.get("plan") or "")


def _track(
    rig: str, quantity: str, rows: Sequence[Row], starts: list[float] | None
) -> Track | None:
    values = [_value(row, quantity) for row in rows]
    kept = [i for i, value in enumerate(values) if value is not None]
    if not kept:
        return None
    y, s = np.array([values[i] for i in kept], dtype=float).T
    return Track(
        rig, quantity, np.array([float(i) if starts is None else starts[i] for i in kept]),
        y, None if quantity in WITHOUT_STD else s, np.array([_plan(rows[i]) for i in kept]),
        tuple(_name(rows[i]) for i in kept),
        np.array([quantity in str(rows[i].get("absent")).split(";") for i in kept]),
        starts is not None,
    )  # fmt: skip


def _value(row: Row, quantity: str) -> tuple[float, float] | None:
    """Return the value and the standard deviation of a quantity; None if they cannot be used.

    For a quantity in `WITHOUT_STD`, the standard deviation is 0.
    """
    with_std = quantity not in WITHOUT_STD
    value, std = row.get(quantity), row.get(quantity + STD) if with_std else 0.0
    if not isinstance(value, float | int) or not isinstance(std, float | int):
        return None
    usable = isfinite(value) and isfinite(std) and (std > 0 or not with_std)
    return (float(f"{value:.{DIGITS}g}"), float(std)) if usable else None
