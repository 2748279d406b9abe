"""Draw a flight, or a plan's references and voltages: panels over one time axis, by matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES
from heli3dof.model.control.loop_task import under_control
from heli3dof.recording.recording import Recording, check_samples
from heli3dof.report.figures.labelled_curves import Curve, label_ends, limits
from heli3dof.report.figures.style import (
    BLUE,
    GREEN,
    GRID,
    MEASURED,
    REFERENCE,
    SOFT,
    SYMBOLS,
    VERMILION,
    Line,
    new_figure,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from heli3dof.experiment.plan import Plan


def flight_figure(recording: Recording) -> Figure:
    """Draw a recording over time: angles and references in degrees, both motor voltages in V.

    Raises RecordingError if the recording has no samples.
    """
    check_samples(recording)
    panels: list[tuple[str, list[Curve]]] = []
    for axis in recording.axes:
        i = AXES.index(axis)
        curves = [Curve("measured", recording.t, np.degrees(recording.angle[:, i]), MEASURED)]
        if recording.has_reference(axis):
            reference = np.degrees(recording.reference[:, i])
            curves.insert(0, Curve("reference", recording.t, reference, REFERENCE))
        panels.append((f"{axis} {SYMBOLS[axis]} (°)", curves))
    panels.append(("voltage (V)", _motors(recording.t, recording.voltage)))
    flown = under_control(recording)
    end = flown.t[-1] if flown.t[-1] < recording.t[-1] else None
    return _panel_figure(panels, f"Flight · {recording.name}", ramp_from_s=end)


def plan_figure(plan: Plan, dt: float) -> Figure:
    """Draw a plan's references in degrees and, if any, the voltages that it adds in V.

    Random signals are generated with the seed 0. ``dt``: the control period in s.
    """
    signals = plan.render(dt, seed=0)
    styles = (Line(BLUE, 1.6), Line(GREEN, 1.6, (3, 1)), Line(VERMILION, 1.6, (6, 1.5)))
    references = [
        Curve(axis, signals.t, np.degrees(signals.reference[:, i]), style)
        for i, (axis, style) in enumerate(zip(AXES, styles, strict=True))
    ]
    panels = [("reference (°)", references)]
    if signals.extra.any():
        panels.append(("added (V)", _motors(signals.t, signals.extra)))
    return _panel_figure(panels, f"Plan · {plan.name}")


def _motors(t: np.ndarray, voltage: np.ndarray) -> list[Curve]:
    """Return a curve for each motor; ``voltage`` (N, 2) in V, at the times ``t`` (N,) in s."""
    return [
        Curve("front", t, voltage[:, 0], Line(BLUE, 1.3)),
        Curve("back", t, voltage[:, 1], Line(VERMILION, 1.1, (5, 1))),
    ]


def _panel_figure(
    panels: Sequence[tuple[str, Sequence[Curve]]], title: str, ramp_from_s: float | None = None
) -> Figure:
    """Draw panels (label, curves) below one another over one time axis.

    ``ramp_from_s``: when the motors begin to ramp to zero, in s; the time from then on is shaded.
    """
    height = 1.0 + 1.35 * len(panels)
    with new_figure(8.6, height, title) as figure:
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
                axes.plot(c.t, c.y, label=c.label, **c.line.kwargs())
            axes.set_ylim(*limits(curves, [c.label for c in curves]))
            axes.set_ylabel(ylabel)
            label_ends(axes, curves, gap=0.17)
        t = panels[0][1][0].t
        if ramp_from_s is not None:
            for axes in column:
                axes.axvspan(ramp_from_s, t[-1], color=GRID, alpha=0.6, linewidth=0)
            column[0].annotate(
                "ramp to zero",
                xy=(ramp_from_s, 1.0),
                xycoords=("data", "axes fraction"),
                xytext=(0, 3),
                textcoords="offset points",
                fontsize=8,
                color=SOFT,
                va="bottom",
            )
        column[-1].set_xlabel("time (s)")
        column[-1].set_xlim(float(t[0]), float(t[-1]))
        figure.align_ylabels()
    return figure
