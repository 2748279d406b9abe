"""Figures 7–9 of the paper, and the overview of a flight.

Figure 7 is roll, 8 pitch, 9 yaw: the reference, the experiment and every model over time. Where
the loop is known the models' curves are closed-loop replays; where it is not they are free
predictions in windows laid end to end, each starting on the measured angles. The line under the
title says what is to be seen, in numbers.

Every function takes arrays or what `compare` made of them, and returns a matplotlib figure;
`heli3dof.report.style` turns it into SVG or PNG.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.compare import FlightComparison, ModelComparison
from heli3dof.recording.recording import Recording
from heli3dof.report.grid import fixed
from heli3dof.report.style import (
    BLUE,
    EXPERIMENT,
    MEASURED,
    RC,
    REFERENCE,
    SOFT,
    VERMILION,
    Line,
    model_lines,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SYMBOLS = {"roll": "r", "pitch": "p", "yaw": "ψ"}
NUMBER = {"roll": 7, "pitch": 8, "yaw": 9}
LABEL_GAP = 0.062
"""Room for one label at the right edge, as a share of the axes' height."""

SUBTITLE_WIDTH = 120
"""Characters of a subtitle that fit on one line."""
MIN_SPAN = 2.0
"""No vertical axis shows less than this, in degrees or volts."""


@dataclass(frozen=True, eq=False)
class Curve:
    """One curve: t (M,) s, y (M,) in the figure's unit; NaN breaks it."""

    label: str
    t: np.ndarray
    y: np.ndarray
    line: Line
    cut_short: bool = False
    """A cross at its last point: it diverged there."""
    dotted_starts: bool = False
    """A dot where each unbroken stretch begins: a prediction sets out from the data there."""


def angle_figure(
    curves: Sequence[Curve], *, title: str, subtitle: str, ylabel: str, frame: Sequence[str] = ()
) -> Figure:
    """Angles over time with a label at each curve's end.

    ``frame`` names the curves that must be seen whole; the others may leave the picture, so that
    one model which runs away does not press the rest flat.
    """
    import matplotlib
    from matplotlib.figure import Figure

    said = textwrap.wrap(subtitle, SUBTITLE_WIDTH) or [""]
    with matplotlib.rc_context(RC):
        height = 3.75 + 0.18 * len(said)
        top = 0.52 + 0.18 * len(said)
        figure = Figure(figsize=(8.6, height))
        axes = figure.add_axes((0.085, 0.52 / height, 0.735, (height - top - 0.52) / height))
        for c in curves:
            axes.plot(c.t, c.y, **c.line.kwargs())
            _marks(axes, c)
        axes.set_ylim(*_limits(curves, frame))
        times = np.concatenate([c.t for c in curves])
        axes.set_xlim(float(np.nanmin(times)), float(np.nanmax(times)))
        axes.set_xlabel("time (s)")
        axes.set_ylabel(ylabel)
        _label_ends(axes, curves)
        headline(figure, title, height)
        for i, line in enumerate(said):
            y = 1 - (0.46 + 0.18 * i) / height
            figure.text(0.015, y, line, fontsize=9, color=SOFT, va="center")
    return figure


def headline(figure: Figure, title: str, height: float) -> None:
    """The title of a figure ``height`` inches high, at its upper left."""
    figure.text(0.015, 1 - 0.21 / height, title, fontsize=11.5, fontweight="bold", va="center")


def _marks(axes: Axes, c: Curve) -> None:
    """Dots where predictions set out from the data, a cross where a model diverged."""
    style: dict[str, Any] = {"color": c.line.color, "zorder": c.line.z + 1, "clip_on": True}
    finite = np.isfinite(c.y)
    if c.dotted_starts:
        start = finite & ~np.concatenate([[False], finite[:-1]])
        axes.plot(c.t[start], c.y[start], "o", markersize=4.5, markeredgecolor="white", **style)
    if c.cut_short and finite.any():
        last = int(np.flatnonzero(finite)[-1])
        axes.plot(c.t[last], c.y[last], "x", markersize=7, markeredgewidth=2, **style)


def comparison_figures(flight: FlightComparison) -> dict[str, Figure]:
    """Figures 7, 8 and 9 by axis; an axis that was not measured has none."""
    return {axis: comparison_figure(flight, axis) for axis in AXES if axis in flight.recording.axes}


def comparison_figure(flight: FlightComparison, axis: str) -> Figure:
    """One of Figures 7–9 for one recording."""
    i, recording = AXES.index(axis), flight.flown
    curves = [Curve("experiment", recording.t, np.degrees(recording.angle[:, i]), EXPERIMENT)]
    if recording.has_reference(axis):
        reference = np.degrees(recording.reference[:, i])
        curves.insert(0, Curve("reference", recording.t, reference, REFERENCE))
    lines = model_lines([m.kind for m in flight.models])
    for m, line in zip(flight.models, lines, strict=True):
        if m.trace is not None and not np.isnan(m.trace.angle[:, i]).all():
            y, free = np.degrees(m.trace.angle[:, i]), m.trace.kind == "prediction"
            cut = m.diverged_at_s is not None
            curves.append(Curve(m.name, m.trace.t, y, line, cut_short=cut, dotted_starts=free))
    what = "in closed loop" if flight.why is None else "predicted freely"
    return angle_figure(
        curves,
        title=f"Figure {NUMBER[axis]}   {axis.capitalize()} {what} · {recording.name}",
        subtitle=_seen(flight, axis),
        ylabel=f"{axis} {SYMBOLS[axis]} (°)",
        frame=("reference", "experiment"),
    )


def flight_figure(recording: Recording) -> Figure:
    """A flight at a glance: the recorded angles with their references, and both voltages."""
    import matplotlib
    from matplotlib.figure import Figure

    panels: list[tuple[str, list[Curve]]] = []
    for axis in recording.axes:
        i = AXES.index(axis)
        curves = [Curve("measured", recording.t, np.degrees(recording.angle[:, i]), MEASURED)]
        if recording.has_reference(axis):
            reference = np.degrees(recording.reference[:, i])
            curves.insert(0, Curve("reference", recording.t, reference, REFERENCE))
        panels.append((f"{axis} {SYMBOLS[axis]} (°)", curves))
    front = Curve("front", recording.t, recording.voltage[:, 0], Line(BLUE, 1.3))
    back = Curve("back", recording.t, recording.voltage[:, 1], Line(VERMILION, 1.1, (5, 1)))
    panels.append(("voltage (V)", [front, back]))

    with matplotlib.rc_context(RC):
        height = 1.0 + 1.35 * len(panels)
        figure = Figure(figsize=(8.6, height))
        column = figure.subplots(
            len(panels),
            1,
            sharex=True,
            squeeze=False,
            gridspec_kw={
                "hspace": 0.2,
                "left": 0.085,
                "right": 0.88,
                "top": 1 - 0.45 / height,
                "bottom": 0.48 / height,
            },
        )[:, 0]
        for axes, (ylabel, curves) in zip(column, panels, strict=True):
            for c in curves:
                axes.plot(c.t, c.y, **c.line.kwargs())
            axes.set_ylim(*_limits(curves, [c.label for c in curves]))
            axes.set_ylabel(ylabel)
            _label_ends(axes, curves, gap=0.17)
        column[-1].set_xlabel("time (s)")
        column[-1].set_xlim(float(recording.t[0]), float(recording.t[-1]))
        headline(figure, f"The flight · {recording.name}", height)
        figure.align_ylabels()
    return figure


def _seen(flight: FlightComparison, axis: str) -> str:
    """The line under the title: what is to be seen, in numbers."""
    parts = []
    if flight.why is None:
        experiment = flight.experiment[axis].reported.peak_deg
        if np.isfinite(experiment):
            parts.append(f"peak: experiment {fixed(experiment, 1, '°')}")
        for m in flight.models:
            parts.append(f"{m.name} {_replay_seen(flight, m, axis)}")
        return _list(parts)
    window = flight.held_still.window_s if flight.held_still else np.nan
    errors = [(m.name, m.prediction) for m in flight.models]
    for name, error in (*errors, ("held still", flight.held_still)):
        if error is not None:
            value = error.over_window_deg[AXES.index(axis)]
            parts.append(f"{name} {fixed(value, 1, '°')}")
    return f"RMSE over {window:g} s windows: " + _list(parts) if parts else "no prediction"


def _list(parts: Sequence[str]) -> str:
    """Parts joined by commas; a line breaks between them only."""
    return ",  ".join(p.replace(" ", "\u00a0") for p in parts if p)


def _replay_seen(flight: FlightComparison, model: ModelComparison, axis: str) -> str:
    if model.diverged_at_s is not None:
        return f"diverges at {model.diverged_at_s:.1f} s"
    if model.metrics is None:
        return "not flown"
    peak = model.metrics[axis].reported.peak_deg
    difference = flight.difference(model, axis)["peak_deg"]
    if not np.isfinite(difference):
        return fixed(peak, 1, "°")
    return f"{fixed(peak, 1, '°')} ({fixed(difference, 1, '°', sign=True)})"


def _limits(curves: Sequence[Curve], frame: Sequence[str]) -> tuple[float, float]:
    """The y range: the framed curves whole, the others as far as one framed range beyond."""
    framed = [c.y[np.isfinite(c.y)] for c in curves if not frame or c.label in frame]
    framed = [y for y in framed if len(y)]
    low = min((float(y.min()) for y in framed), default=-1.0)
    high = max((float(y.max()) for y in framed), default=1.0)
    room = max(high - low, 1.0)
    everything = [c.y[np.isfinite(c.y)] for c in curves if np.isfinite(c.y).any()]
    low_all = min((float(y.min()) for y in everything), default=low)
    high_all = max((float(y.max()) for y in everything), default=high)
    low, high = max(low_all, low - room), min(high_all, high + room)
    # An axis at rest shall look at rest: its encoder's counts are no event.
    short = max(0.0, MIN_SPAN - (high - low)) / 2
    margin = 0.06 * (high - low + 2 * short)
    return low - short - margin, high + short + margin


def _label_ends(axes: Axes, curves: Sequence[Curve], gap: float = LABEL_GAP) -> None:
    """Each curve's name at the right edge beside its end, moved apart where they would meet."""
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
            c.label,
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
    """The name of a curve that stops early, where it leaves the picture."""
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
        c.label,
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
    """Sorted places moved apart by at least ``gap``, within 0…1 where there is room, and little.

    >>> spread(np.array([0.5, 0.5]), 0.1).tolist()
    [0.45, 0.55]
    """
    if not len(places):
        return places
    # Blocks of touching labels, each centred on the mean of where its labels would be.
    blocks: list[list[float]] = []
    for place in places:
        blocks.append([float(place)])
        while len(blocks) > 1 and _start(blocks[-1], gap) < _end(blocks[-2], gap) + gap:
            last = blocks.pop()
            blocks[-1] += last
    return np.concatenate([_start(b, gap) + gap * np.arange(len(b), dtype=float) for b in blocks])


def _start(block: list[float], gap: float) -> float:
    """Where a block's first label stands: centred, but not below 0 nor above 1."""
    length = gap * (len(block) - 1)
    return float(np.clip(np.mean(block) - length / 2, 0.0, max(1.0 - length, 0.0)))


def _end(block: list[float], gap: float) -> float:
    return _start(block, gap) + gap * (len(block) - 1)
