"""Draw Figures 7–9 of the paper, and the overview of a flight, with matplotlib.

Figure 7 is roll, 8 pitch, 9 yaw: reference, experiment and every model over time. If the controller
is known, the models' curves are closed-loop replays. Otherwise they are multi-step predictions in
successive windows, each starting at the measured angles. The subtitle gives the peaks of the
replays or the RMSE of the predictions. `heli3dof.report.figure_style` writes SVG or PNG.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.replay import under_control
from heli3dof.comparison.result import Comparison, FlightComparison, ModelComparison
from heli3dof.errors import UsageError
from heli3dof.recording.recording import Recording
from heli3dof.report.figure_style import (
    BLUE,
    EXPERIMENT,
    GREEN,
    GRID,
    MEASURED,
    RC,
    REFERENCE,
    SOFT,
    VERMILION,
    Line,
    model_lines,
)
from heli3dof.report.labelled_curves import Curve, angle_figure, headline, label_ends, limits
from heli3dof.report.text_table import fixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from heli3dof.experiment.plan import Plan

SYMBOLS = {"roll": "r", "pitch": "p", "yaw": "ψ"}
NUMBER = {"roll": 7, "pitch": 8, "yaw": 9}


def comparison_figures(comparison: Comparison) -> dict[str, dict[str, Figure]]:
    """Draw the paper's Figures 7, 8 and 9; the result is recording's name → axis → figure.

    The second recording with the same name gets a number. An axis that was not measured has no
    figure.
    """
    figures: dict[str, dict[str, Figure]] = {}
    for flight in comparison.flights:
        name = flight.recording.name
        k = sum(f.recording.name == name for f in comparison.flights[: len(figures)])
        figures[name if k == 0 else f"{name} ({k + 1})"] = axis_figures(flight)
    return figures


def comparison_plot(
    comparison: Comparison, axis: str = "roll", recording: str | None = None
) -> Figure:
    """Draw the paper's Figure 7, 8 or 9, by ``axis``, for the named or the first recording.

    Raises UsageError if there is no such recording or angle.
    """
    for flight in comparison.flights:
        if recording in (None, flight.recording.name) and axis in flight.recording.axes:
            return comparison_figure(flight, axis)
    raise UsageError(
        f"There is no figure of {axis} of {recording or 'any recording'}.",
        cause="the angle was not recorded, or a typing error.",
        fix=f"recordings: {', '.join(f.recording.name for f in comparison.flights)}",
    )


def axis_figures(flight: FlightComparison) -> dict[str, Figure]:
    """Draw the paper's Figures 7, 8 and 9 for one recording; return axis name → figure."""
    return {axis: comparison_figure(flight, axis) for axis in AXES if axis in flight.recording.axes}


def comparison_figure(flight: FlightComparison, axis: str) -> Figure:
    """Draw one recording's angle on ``axis`` over time: reference, experiment and models."""
    i, recording = AXES.index(axis), flight.flown
    curves = [Curve("experiment", recording.t, np.degrees(recording.angle[:, i]), EXPERIMENT)]
    if recording.has_reference(axis):
        reference = np.degrees(recording.reference[:, i])
        curves.insert(0, Curve("reference", recording.t, reference, REFERENCE))
    lines = model_lines([m.kind for m in flight.models])
    for m, line in zip(flight.models, lines, strict=True):
        if m.trace is not None and not np.isnan(m.trace.angle[:, i]).all():
            y, windows = np.degrees(m.trace.angle[:, i]), m.trace.kind == "prediction"
            cut = m.diverged_at_s is not None
            curves.append(Curve(m.name, m.trace.t, y, line, cut_short=cut, dotted_starts=windows))
    what = "in closed loop" if flight.why is None else "predictions"
    return angle_figure(
        curves,
        title=f"Figure {NUMBER[axis]}   {axis.capitalize()} {what} · {recording.name}",
        subtitle=_subtitle(flight, axis),
        ylabel=f"{axis} {SYMBOLS[axis]} (°)",
        frame=("reference", "experiment"),
    )


def flight_figure(recording: Recording) -> Figure:
    """Draw a recording over time: angles and references in degrees, both motor voltages in V."""
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
    """Draw what a plan asks for: references in degrees and, if any, the added voltages in V.

    Random signals are drawn with the seed 0. ``dt``: the control period in s.
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
    """Return curves of both motors' voltages (N, 2) in V."""
    return [
        Curve("front", t, voltage[:, 0], Line(BLUE, 1.3)),
        Curve("back", t, voltage[:, 1], Line(VERMILION, 1.1, (5, 1))),
    ]


def _panel_figure(
    panels: Sequence[tuple[str, Sequence[Curve]]], title: str, ramp_from_s: float | None = None
) -> Figure:
    """Draw panels (label, curves) below one another over one time axis.

    ``ramp_from_s``: time from which the motors ramp to zero, which is shaded.
    """
    import matplotlib
    from matplotlib.figure import Figure

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
        headline(figure, title, height)
        figure.align_ylabels()
    return figure


def _subtitle(flight: FlightComparison, axis: str) -> str:
    """Return a figure's subtitle: peaks if the closed loop was replayed, else prediction RMSE."""
    parts = []
    if flight.why is None:
        experiment = flight.experiment[axis].reported.peak_deg
        if np.isfinite(experiment):
            parts.append(f"peak: experiment {fixed(experiment, 1, '°')}")
        for m in flight.models:
            parts.append(f"{m.name} {_replay_peak(flight, m, axis)}")
        return _list(parts)
    window = flight.constant_angles.window_s if flight.constant_angles else np.nan
    errors = [(m.name, m.prediction) for m in flight.models]
    for name, error in (*errors, ("constant angles", flight.constant_angles)):
        if error is not None:
            value = error.over_window_deg[AXES.index(axis)]
            parts.append(f"{name} {fixed(value, 1, '°')}")
    return f"RMSE over {window:g} s windows: " + _list(parts) if parts else "no prediction"


def _list(parts: Sequence[str]) -> str:
    """Return the non-empty parts joined by commas; a line can break only between two parts."""
    return ",  ".join(p.replace(" ", "\u00a0") for p in parts if p)


def _replay_peak(flight: FlightComparison, model: ModelComparison, axis: str) -> str:
    if model.diverged_at_s is not None:
        return f"diverges at {model.diverged_at_s:.1f} s"
    if model.metrics is None:
        return "not replayed"
    peak = model.metrics[axis].reported.peak_deg
    difference = flight.difference(model, axis)["peak_deg"]
    if not np.isfinite(difference):
        return fixed(peak, 1, "°")
    return f"{fixed(peak, 1, '°')} ({fixed(difference, 1, '°', sign=True)})"
