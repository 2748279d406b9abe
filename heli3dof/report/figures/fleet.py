"""Draw one quantity of a fleet: each rig's flights over time, the fleet's mean, the changes.

Points are flights with error bars of one standard deviation. A rig's mean uses only flights of one
experiment plan; flights of other plans are hollow points. The line is the rig's mean since its last
step (sudden change), the grey band the 95 % interval of the fleet's mean. A vertical band between
two flights marks a step. A dashed line is a drift, a cross marks a deviating flight.
"""

from __future__ import annotations

from math import ceil
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.fleet.result import Fleet, FleetQuantity, RigQuantity
from heli3dof.report.figures.style import (
    BLUE,
    GRID,
    INK,
    ORANGE,
    SOFT,
    VERMILION,
    Line,
    new_figure,
    plain,
)
from heli3dof.report.text.fleet_sentences import date

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = 4
"""Number of panels side by side"""
PANEL = (2.4, 1.5)
"""in: width and height of a panel"""
HEAD, FOOT = 0.75, 0.5
"""in: height above and below the panels"""
MEAN = Line(BLUE, 1.6, (), 4)
DRIFT = Line(VERMILION, 1.4, (6, 1.5), 5)


def fleet_figure(fleet: Fleet, quantity: str = "") -> Figure:
    """Draw the named quantity; default: the first that changed, or the fleet's first quantity."""
    changed = [track.quantity for track, _ in fleet.changes()]
    name = quantity or next(iter([*changed, fleet.quantities[0].name]))
    return quantity_figure(next(q for q in fleet.quantities if q.name == name))


def quantity_figure(q: FleetQuantity) -> Figure:
    """Draw one quantity: a panel for each rig, all with the same vertical axis."""
    columns = min(COLUMNS, len(q.rigs))
    rows = ceil(len(q.rigs) / columns)
    width, height = max(columns * PANEL[0], 6.4), rows * PANEL[1] + HEAD + FOOT
    dated = all(r.track.dated for r in q.rigs)
    start = min(float(r.track.t[0]) for r in q.rigs)
    with new_figure(width, height, q.name) as figure:
        panels = figure.subplots(rows, columns, sharex=dated, sharey=True, squeeze=False)
        figure.subplots_adjust(
            0.62 / width, FOOT / height, 1 - 0.12 / width, 1 - HEAD / height, 0.12, 0.42
        )
        for axes, r in zip(panels.flat, q.rigs, strict=False):
            _panel(axes, q, r, start if dated else 0.0)
        for axes in panels.flat[len(q.rigs) :]:
            axes.set_axis_off()
        unit = f"days since {date(start)}" if dated else "number of the flight"
        for axes in panels.flat[max(0, len(q.rigs) - columns) : len(q.rigs)]:
            axes.set_xlabel(unit, fontsize=8)
            axes.tick_params(labelbottom=True)
        text = (
            "Flights ± one standard deviation; line: mean since the last step; grey: fleet's mean"
        )
        if any((r.track.plans != r.plan).any() for r in q.rigs):
            text += "; hollow: other plans"
        figure.text(0.015, 1 - 0.44 / height, plain(text), fontsize=8.5, color=SOFT, va="center")
    return figure


def figure_alt(q: FleetQuantity) -> str:
    """Return the alternative text of `quantity_figure`."""
    return f"{q.name} of {len(q.rigs)} rigs over their flights"


def _panel(axes: Any, q: FleetQuantity, r: RigQuantity, start: float) -> None:
    """Draw one rig's flights; ``start``: the day that is 0 on the horizontal axis."""
    track, t = r.track, r.track.t - start
    if q.fleet is not None and len(q.rigs) > 1:
        low, high = q.fleet.interval
        axes.axhspan(low, high, color=GRID, linewidth=0, zorder=0)
    for change in r.changes:
        if change.kind == "step":
            axes.axvspan(t[change.last], t[change.first], color=ORANGE, linewidth=0, zorder=1)
    error = np.zeros_like(t) if track.s is None else track.s
    same = track.plans == r.plan
    for rows, face in ((same, INK), (~same, "white")):
        if rows.any():
            axes.errorbar(
                t[rows], track.y[rows], yerr=error[rows], fmt="o", color=INK, markersize=2.6,
                markerfacecolor=face, elinewidth=0.8, zorder=3, label=plain(track.rig),
            )  # fmt: skip
    now = t[r.present]
    axes.plot(now[[0, -1]], 2 * [r.estimate.value], label="mean", **MEAN.kwargs())
    for change in r.changes:
        at = t[[change.first, change.last]]
        if change.kind == "drift":
            middle = float(np.mean(track.y[change.first : change.last + 1]))
            ends = [middle - change.size / 2, middle + change.size / 2]
            axes.plot(at, ends, label="drift", **DRIFT.kwargs())
        if change.kind == "deviating":
            axes.plot(
                at[:1], track.y[[change.first]], "x", color=VERMILION, markersize=8,
                markeredgewidth=1.8, zorder=6, label="deviating",
            )  # fmt: skip
    axes.set_title(plain(track.rig), loc="left", fontsize=8.5, pad=3)
    axes.tick_params(labelsize=7.5)
