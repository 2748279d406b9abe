"""Plot curves over time with a label at each curve's end instead of a legend.

Overlapping labels are moved apart. If a model diverged, its curve ends early, and the label is at
this end.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.report.figures.style import SOFT, Line, new_figure, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LABEL_GAP = 0.062
"""Height of one label, as a share of the axes' height"""

SUBTITLE_WIDTH, LABEL_WIDTH = 120, 20
"""Largest numbers of characters on a line of the subtitle, and in a label"""
MIN_SPAN = 2.0
"""Least range of a vertical axis, in degrees or volts (a convention)"""


@dataclass(frozen=True, eq=False)
class Curve:
    """A named curve: times t (M,) in s, values y (M,) in the figure's unit; NaN breaks the line."""

    label: str
    t: np.ndarray
    y: np.ndarray
    line: Line
    cut_short: bool = False
    """True: a cross marks the curve's last point, because the model diverged there."""
    dotted_starts: bool = False
    """True: a dot marks the start of each unbroken stretch, because a prediction starts there."""


def angle_figure(
    curves: Sequence[Curve], *, title: str, subtitle: str, ylabel: str, frame: Sequence[str] = ()
) -> Figure:
    """Draw angles over time with a label at each curve's end.

    ``frame`` names the curves that determine the vertical range (empty: all). Other curves widen
    it at most threefold, so that a diverging model does not flatten the rest.
    """
    lines = textwrap.wrap(plain(subtitle, 4 * SUBTITLE_WIDTH), SUBTITLE_WIDTH) or [""]
    height = 3.75 + 0.18 * len(lines)
    top = 0.52 + 0.18 * len(lines)
    with new_figure(8.6, height, title) as figure:
        axes = figure.add_axes((0.085, 0.52 / height, 0.735, (height - top - 0.52) / height))
        for c in curves:
            axes.plot(c.t, c.y, label=c.label, **c.line.kwargs())
            _marks(axes, c)
        axes.set_ylim(*limits(curves, frame))
        times = np.concatenate([c.t for c in curves])
        axes.set_xlim(float(np.nanmin(times)), float(np.nanmax(times)))
        axes.set_xlabel("time (s)")
        axes.set_ylabel(ylabel)
        label_ends(axes, curves)
        for i, line in enumerate(lines):
            y = 1 - (0.46 + 0.18 * i) / height
            figure.text(0.015, y, line, fontsize=9, color=SOFT, va="center")
    return figure


def short_label(label: str) -> str:
    """Return a curve's label for matplotlib, cut to `LABEL_WIDTH` characters in its middle.

    Names of files often differ only at their ends.

    >>> short_label("open-roll-7V-1-extended-2")
    'open-roll…extended-2'
    """
    if len(label) > LABEL_WIDTH:
        label = label[: LABEL_WIDTH // 2 - 1] + "…" + label[-LABEL_WIDTH // 2 :]
    return plain(label)


def _marks(axes: Axes, c: Curve) -> None:
    """Draw dots where predictions start on curve ``c``, and a cross where its model diverged."""
    style: dict[str, Any] = {"color": c.line.color, "zorder": c.line.z + 1, "clip_on": True}
    finite = np.isfinite(c.y)
    if c.dotted_starts:
        start = finite & ~np.concatenate([[False], finite[:-1]])
        axes.plot(c.t[start], c.y[start], "o", markersize=4.5, markeredgecolor="white", **style)
    if c.cut_short and finite.any():
        last = int(np.flatnonzero(finite)[-1])
        axes.plot(c.t[last], c.y[last], "x", markersize=7, markeredgewidth=2, **style)


def limits(curves: Sequence[Curve], frame: Sequence[str]) -> tuple[float, float]:
    """Return the ends of the vertical axis; ``frame``: as in `angle_figure`."""
    framed = [c.y[np.isfinite(c.y)] for c in curves if not frame or c.label in frame]
    framed = [y for y in framed if len(y)]
    low = min((float(y.min()) for y in framed), default=-1.0)
    high = max((float(y.max()) for y in framed), default=1.0)
    room = max(high - low, 1.0)
    everything = [c.y[np.isfinite(c.y)] for c in curves if np.isfinite(c.y).any()]
    low_all = min((float(y.min()) for y in everything), default=low)
    high_all = max((float(y.max()) for y in everything), default=high)
    low, high = max(low_all, low - room), min(high_all, high + room)
    # Single encoder counts of an axis at rest must not fill the axes.
    short = max(0.0, MIN_SPAN - (high - low)) / 2
    margin = 0.06 * (high - low + 2 * short)
    return low - short - margin, high + short + margin


def label_ends(axes: Axes, curves: Sequence[Curve], gap: float = LABEL_GAP) -> None:
    """Write each curve's name at the right edge, at least ``gap`` (share of axes' height) apart."""
    low, high = axes.get_ylim()
    ends: list[tuple[float, Curve]] = []
    for c in curves:
        finite = c.y[np.isfinite(c.y)]
        if c.cut_short:
            _label_exit(axes, c)
        elif len(finite):
            ends.append((float(np.clip((finite[-1] - low) / (high - low), 0, 1)), c))
    ends.sort(key=lambda e: e[0])
    places = spread(np.array([e[0] for e in ends]), gap)
    for (end, c), place in zip(ends, places, strict=True):
        axes.annotate(
            short_label(c.label),
            xy=(1.0, end),
            xytext=(1.035, place),
            xycoords="axes fraction",
            color=c.line.color,
            fontsize=9,
            va="center",
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": c.line.color,
                "linewidth": 0.7,
                "relpos": (0.0, 0.5),
                "shrinkA": 1,
                "shrinkB": 1,
            },
        )


def _label_exit(axes: Axes, c: Curve) -> None:
    """Write the name of a diverged model's curve at the last visible point of the curve."""
    from matplotlib import patheffects

    low, high = axes.get_ylim()
    with np.errstate(invalid="ignore"):
        seen = np.flatnonzero((c.y >= low) & (c.y <= high))
    if not len(seen):
        return
    t, y = float(c.t[seen[-1]]), float(c.y[seen[-1]])
    below = y > low + 0.15 * (high - low)
    halo = patheffects.withStroke(linewidth=3, foreground="white")
    axes.annotate(
        short_label(c.label),
        xy=(t, y),
        xytext=(9, -22 if below else 9),
        textcoords="offset points",
        color=c.line.color,
        fontsize=9,
        va="center",
        zorder=9,
        path_effects=[halo],
    )


def spread(places: np.ndarray, gap: float) -> np.ndarray:
    """Return the sorted label heights ``places`` (0…1), moved ``gap`` apart where they are closer.

    >>> spread(np.array([0.5, 0.5]), 0.1).tolist()
    [0.45, 0.55]
    """
    from scipy.optimize import isotonic_regression

    if not len(places):
        return places
    # Least squares: the heights less those of labels packed from 0 upwards may not fall.
    packed = gap * np.arange(len(places), dtype=float)
    above = isotonic_regression(places - packed).x
    return np.asarray(packed + np.clip(above, 0.0, max(1.0 - packed[-1], 0.0)))
