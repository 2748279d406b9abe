"""Make the tables of a fleet: the rigs' main quantities, all quantities, bad recordings."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from heli3dof.fleet.random_effects import Estimate
from heli3dof.fleet.result import Fleet, FleetQuantity, RigQuantity
from heli3dof.report.text.number_format import NONE, significant
from heli3dof.report.text.table import Grid


@dataclass(frozen=True)
class Column:
    """A table column for the first quantity whose name matches the regular expression ``pattern``.

    ``factor`` converts the quantity to the unit in ``title``.
    """

    pattern: str
    title: str
    factor: float = 1.0


MAIN = (
    Column(r"thrust_gain_ratio", "thrust gain"),
    Column(r"hover_voltage_V", "hover V"),
    Column(r"friction\.\w+\.yaw\..*", "yaw friction"),
    Column(r"encoder\.offset\.roll\..*", "roll zero °"),
    Column(r"motor\.lag\..*", "lag ms", 1e3),
    Column(r"jitter_s", "jitter µs", 1e6),
    Column(r"lost_share", "lost %", 100.0),
    Column(r"encoder\.offset\.pitch\..*", "pitch zero °"),
    Column(r"encoder\.offset\.yaw\..*", "yaw zero °"),
    Column(r"friction\.\w+\.roll\..*", "roll friction"),
    Column(r"friction\.\w+\.pitch\..*", "pitch friction"),
    Column(r"late_share", "late %", 100.0),
)
"""Columns of the main quantities, the most important first"""
MOST_COLUMNS = 7
"""Largest number of quantities in `rig_table`, so that it fits into 100 characters"""
MARKS = "* changed or drifts; ! differs from the other rigs and is not in the last row."


def rig_table(fleet: Fleet) -> Grid:
    """Return a table of the main quantities: a row per rig; with several rigs, also their means."""
    chosen = main_quantities(fleet)
    rows = []
    for rig in fleet.rigs:
        of_rig = [next((r for r in q.rigs if r.track.rig == rig), None) for q, _ in chosen]
        cells = (_cell(r, c.factor) for r, (_, c) in zip(of_rig, chosen, strict=True))
        rows.append((rig, *cells))
    if len(fleet.rigs) > 1:
        means = (
            _value(q.fleet, c.factor) if q.fleet and len(q.rigs) > 1 else NONE for q, c in chosen
        )
        rows.append(("all rigs", *means))
    return Grid(
        "Main quantities of each rig since its last step, ± half of the 95 % interval",
        ("rig", *(column.title for _, column in chosen)),
        rows,
        (MARKS,),
    )


def main_quantities(fleet: Fleet) -> list[tuple[FleetQuantity, Column]]:
    """Return at most `MOST_COLUMNS` pairs (quantity, table column), in the order of `MAIN`.

    A column of `MAIN` shows the fleet's first quantity whose name matches the column's ``pattern``.
    A column without such a quantity is left out. If no name matches any pattern, the columns are
    the first `MOST_COLUMNS` quantities of the fleet, with their names as titles.
    """
    found = []
    for column in MAIN:
        named = (q for q in fleet.quantities if re.fullmatch(column.pattern, q.name))
        found += [(q, column) for q in list(named)[:1]]
    if not found:
        found = [(q, Column(re.escape(q.name), q.name)) for q in fleet.quantities]
    return found[:MOST_COLUMNS]


def quantity_table(q: FleetQuantity) -> Grid:
    """Return one quantity's table: each rig's estimate, 95 % interval, scatter between flights."""
    rows = [(r.track.rig, *_numbers(r.estimate), _marks(r)) for r in q.rigs]
    if q.fleet is not None and len(q.rigs) > 1:
        rows.append(("all rigs", *_numbers(q.fleet), ""))
    return Grid(
        q.name,
        ("rig", "flights", "value", "low", "high", "scatter", ""),
        rows,
        (
            "Flights since the last step; scatter: standard deviation between flights, in the "
            "last row between rigs.",
        ),
    )


def bad_table(fleet: Fleet) -> Grid:
    """Return a table of the recordings that are not used, each with the reason."""
    rows = [(b.recording, b.rig, b.reason) for b in fleet.bad]
    return Grid("Recordings not used", ("recording", "rig", "reason"), rows, text_columns=3)


def _numbers(e: Estimate) -> Sequence[str]:
    low, high = e.interval
    half = 0.5 * (high - low)
    values = (e.value, low, high)
    return (str(e.n), *(significant(v, half) for v in values), significant(e.scatter, e.scatter))


def _cell(r: RigQuantity | None, factor: float) -> str:
    if r is None:
        return NONE
    # A figure space keeps the numbers of unmarked rows in line.
    return _value(r.estimate, factor) + (_marks(r) or "\u2007")


def _marks(r: RigQuantity) -> str:
    changed = r.has("step") or r.has("drift")
    return ("*" if changed else "") + ("!" if r.difference else "")


def _value(e: Estimate, factor: float) -> str:
    low, high = e.interval
    half = 0.5 * factor * (high - low)
    if not half > 0:
        return significant(factor * e.value)
    digits = significant(half, 10 * half)  # one digit of the half width
    return f"{significant(factor * e.value, 10 * half)} ± {digits}"
