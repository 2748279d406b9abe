"""Join the tables of several logs of one flight on their common clock.

The joined table has one row for each instant at which every log has a sample. These instants are
sampling times of the slowest log. For each signal of a faster log, `join` also computes the mean
over the interval from one row to the next. `lower_rate.with_mean_voltages` later replaces the
sampled voltages by these means.
"""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np

from heli3dof.errors import RecordingError
from heli3dof.recording.atomic_write import stem
from heli3dof.recording.logs.importer import Table
from heli3dof.recording.logs.known_names import own_name
from heli3dof.recording.logs.log_validation import check_time_increases
from heli3dof.recording.logs.lower_rate import MEANS, interval_means
from heli3dof.rig.log_columns import KNOWN

CLOCK_NAMES = ("t_s", "time", "t", "tout", "time_s", "seconds")
"""Names (lower case) that a log's clock may have, in order of priority"""
SAME_INSTANT = 0.1
"""Largest difference of one sample's times between logs, as a share of the shortest period (a
convention)"""
SAME_RATE = 0.01
"""Largest relative difference of a period from a fraction 1/n of the longest one (a convention)"""
MAX_MULTIPLE = 20
"""Largest n; a larger ratio of periods comes from a clock in other units (a convention)"""
PARTNERS = 0.5
"""In the time range common to all logs, at least this share of the slowest log's samples must have
a sample at the same instant (`SAME_INSTANT`) in every other log (a convention)"""
NAMED = 2
"""Largest number of signals of a file that a message names"""


def clock_of(names: Iterable[str]) -> str | None:
    """Return the name of the time vector among the ``names`` of signals; None if there is none.

    `CLOCK_NAMES` lists the possible names in order of priority. The comparison ignores upper case.
    """
    lower = {name.lower(): name for name in reversed(list(names))}
    return next((lower[clock] for clock in CLOCK_NAMES if clock in lower), None)


def with_clock(table: Table) -> Table:
    """Return ``table`` with its time vector as column ``t_s``.

    A table without a time vector is returned unchanged.
    """
    name = clock_of(table.columns)
    if name is None or "t_s" in table.columns:
        return table
    columns = {"t_s": table.columns[name], **table.columns}
    return replace(table, columns=columns, origins={**table.origins, "t_s": name})


def join(tables: Sequence[Table]) -> Table:
    """Return one table with the columns of all tables, at the instants that all clocks contain.

    A column name that occurs in several tables gets its file's name as a prefix: ``input.u``. A
    table without a clock must have as many samples as the first table with a clock. Raises
    RecordingError if these numbers differ, if the clocks do not overlap or have no common instants,
    or if their rates are no integer multiples.
    """
    tables = [with_clock(table) for table in tables]
    if len(tables) == 1:
        return tables[0]
    clocked = [table for table in tables if "t_s" in table.columns]
    first = (clocked or tables)[0]
    rows = _common_rows(clocked)
    columns: dict[str, np.ndarray] = {}
    means: dict[str, np.ndarray] = {}
    paths: dict[str, str] = {}
    warnings = [f"{table.source}: {w}" for table in tables for w in table.warnings]
    seen = Counter(name for table in tables for name in table.columns)
    for table in tables:
        n = len(table)
        if "t_s" not in table.columns and n != len(first):
            named = (
                f"{next(iter(t.columns))} in {t.source}: {len(t)} samples" for t in (first, table)
            )
            raise RecordingError(
                f"The signals have different lengths, and one has no clock: {', '.join(named)}.",
                cause="they were logged at different rates, or are of different flights.",
                fix="log all of them at the control rate, each with its time",
            )
        keep = rows.get(id(table), rows.get(id(first), np.arange(n)))
        is_faster = len(keep) > 1 and float(np.median(np.diff(keep))) > 1
        if len(keep) < n and "t_s" in table.columns:
            others = [
                _signals(t)
                for t in clocked
                if not np.array_equal(t.columns["t_s"], table.columns["t_s"])
            ]
            text = (
                f"{_signals(table)}: {n - len(keep)} of {n} samples were left out, for "
                f"lack of samples of {' and '.join(others[:NAMED])} at these times."
            )
            if is_faster:
                kept_hz = 1 / float(np.median(np.diff(table.columns["t_s"][keep])))
                text += (
                    f" The other rows are kept, {MEANS} If the profile has another loop.rate_hz, "
                    f"add --rate {kept_hz:.4g}."
                )
            else:
                text += " If these signals are of different flights, use those of one only."
            warnings.append(text)
        for name, values in table.columns.items():
            is_clock = name in ("t_s", table.origins.get("t_s"))
            if is_clock and table is not first:
                continue
            own = name if is_clock or seen[name] == 1 else f"{stem(Path(table.source))}.{name}"
            if own in columns:
                raise RecordingError(
                    f"Two signals are named {own}.",
                    cause=f"{table.source} was given twice, or is a file of two flights.",
                    fix="name every file of one flight once; rename one of the signals",
                )
            columns[own] = values[keep]
            if is_faster:
                means[own] = interval_means(values, keep)
            paths |= {f"{own[: -len(name)]}{p}": own for p, c in table.paths.items() if c == name}
    return Table(
        " + ".join(dict.fromkeys(table.source for table in tables)),
        columns,
        lambda k: f"sample {k + 1}",
        warnings,
        next((table.profile for table in tables if table.profile is not None), None),
        first.origins,
        [text for table in tables for text in table.ignored],
        means,
        paths,
        [f"{table.source}: {text}" for table in tables for text in table.notes],
    )


def join_used(tables: Sequence[Table], expressions: Iterable[str]) -> Table:
    """Join the tables of one file; leave out unused tables that would remove rows of the others.

    A table is used if it has a column that `import` needs (`_is_used`). The function joins all used
    tables. It adds an unused table only if `join` raises no error and the joined table keeps all
    rows. The result's ``ignored`` lists the tables that are left out. If no table is used, the
    function joins all tables.
    """
    text = "\n".join(expressions)
    is_kept = [_is_used(table, text) for table in tables]
    if not any(is_kept) or all(is_kept):
        return join(tables)

    def joined() -> Table:
        return join(list(itertools.compress(tables, is_kept)))

    result = joined()
    ignored = [entry for table in tables for entry in table.ignored]
    for i in [i for i, kept in enumerate(is_kept) if not kept]:
        is_kept[i] = True
        with suppress(RecordingError):
            wider = joined()
            if len(wider) == len(result):
                result = wider
                continue
        is_kept[i] = False
        ignored.append(f"{_signals(tables[i])}: not mapped, and not sampled at all times")
    return replace(result, ignored=ignored)


def _is_used(table: Table, text: str) -> bool:
    """Return True if `import` needs at least one column of ``table``, apart from its time vector.

    ``text``: the expressions from which `import` computes the recording's columns. `import` needs a
    column in two cases:

    - docs/reference/recording.md lists the column's name. A name with a unit in brackets counts,
      too: ``Roll [deg]`` stands for the listed ``roll_deg``.
    - ``text`` contains the column's name or its full path in the file.
    """
    names = table.columns.keys() - {"t_s", table.origins.get("t_s")}
    own = any(name in KNOWN or own_name(name) for name in names)
    words = [re.escape(name) for name in (*names, *table.paths)]
    return own or bool(words and re.search(rf"(?<![\w.\]])(?:{'|'.join(words)})(?![\w(\[])", text))


def _common_rows(tables: Sequence[Table]) -> dict[int, np.ndarray]:
    """Return ``id(table)`` → indices (n,) of the table's rows at instants common to all tables."""
    if not tables:
        return {}
    times = [table.columns["t_s"] for table in tables]
    if all(np.array_equal(times[0], other) for other in times):
        return {id(table): np.arange(len(times[0])) for table in tables}
    for table in tables:
        check_time_increases(table.source, table.columns["t_s"], table.where)
    periods = [float(np.median(np.diff(t))) for t in times]
    slowest = int(np.argmax(periods))
    t, fastest_s = times[slowest], min(periods)
    partners = []
    for table, other, period in zip(tables, times, periods, strict=True):
        _check_rate(tables[slowest], periods[slowest], table, period)
        k = np.clip(np.searchsorted(other, t), 1, len(other) - 1)
        k = k - (t - other[k - 1] < other[k] - t)
        partners.append(np.where(np.abs(other[k] - t) < SAME_INSTANT * fastest_s, k, -1))
    keep = np.all([k >= 0 for k in partners], axis=0)
    low, high = max(x[0] for x in times), min(x[-1] for x in times)
    ranges = ", ".join(
        f"{_signals(T)} {x[0]:.6g} … {x[-1]:.6g} s" for T, x in zip(tables, times, strict=True)
    )
    if low > high:
        raise RecordingError(
            f"The clocks of the files do not overlap: {ranges}.",
            cause="files of different flights, or clocks with different starts or units.",
            fix="give the files of one flight; let one model log them",
        )
    if keep.sum() < PARTNERS * np.sum((t >= low) & (t <= high)):
        raise RecordingError(
            f"The files were sampled at different instants: {ranges}.",
            cause="two programs logged them, or one log has gaps.",
            fix="let one model log all signals at the control rate",
        )
    return {id(table): k[keep] for table, k in zip(tables, partners, strict=True)}


def _check_rate(slowest: Table, longest_s: float, other: Table, period_s: float) -> None:
    """Raise RecordingError unless ``longest_s`` is n times ``period_s``, n = 1 … `MAX_MULTIPLE`.

    n is an integer; a relative deviation of up to `SAME_RATE` is allowed. ``longest_s``: sampling
    period of the table ``slowest``; ``period_s``: that of the table ``other``.
    """
    multiple = round(longest_s / period_s)
    if multiple > MAX_MULTIPLE or abs(longest_s / period_s / multiple - 1) > SAME_RATE:
        raise RecordingError(
            f"{_signals(slowest)} and {_signals(other)} are sampled at different rates: every "
            f"{longest_s:.6g} and every {period_s:.6g} (time in s).",
            cause="sample times that are no multiples of each other, or a clock in milliseconds.",
            fix="log all signals at the control rate, with time in seconds",
        )


def _signals(table: Table) -> str:
    """Return the names of a table's first signals and of its file, for messages.

    >>> _signals(Table("log.mat", {"t_s": np.arange(9), "V[1]": np.ones(9)}, str))
    'V[1] in log.mat'
    """
    names = [name for name in table.columns if name not in ("t_s", table.origins.get("t_s"))]
    more = ", …" if len(names) > NAMED else ""
    return f"{', '.join(names[:NAMED])}{more} in {table.source}"
