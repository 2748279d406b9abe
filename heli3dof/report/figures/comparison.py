"""Draw Figures 7–9 of the paper, with matplotlib.

Figure 7 is roll, 8 pitch, 9 yaw: reference, experiment and every model over time. If the controller
is known, the models' curves are closed-loop replays. Otherwise they are multi-step predictions in
successive windows, each starting at the measured angles. The subtitle gives the peaks of the
replays or the RMSE of the predictions. `heli3dof.report.figures.style` writes SVG or PNG.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from heli3dof.axes import AXES
from heli3dof.comparison.result import Comparison, FlightComparison, ModelComparison
from heli3dof.errors import UsageError
from heli3dof.report.figures.labelled_curves import Curve, angle_figure
from heli3dof.report.figures.style import EXPERIMENT, REFERENCE, SYMBOLS, model_lines
from heli3dof.report.text.number_format import fixed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUMBER = {"roll": 7, "pitch": 8, "yaw": 9}


def comparison_figures(comparison: Comparison) -> dict[str, dict[str, Figure]]:
    """Draw the paper's Figures 7, 8 and 9; return a nested dict: recording's name → axis → figure.

    A further recording of the same name is called "name (2)". An axis that was not measured has no
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
    """Draw the paper's Figure 7, 8 or 9 (roll, pitch or yaw) for one recording.

    ``recording``: its name; None: the first with this angle. Raises UsageError if there is none.
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
        title=f"{axis.capitalize()} {what} · {recording.name} (the paper's Figure {NUMBER[axis]})",
        subtitle=_subtitle(flight, axis),
        ylabel=f"{axis} {SYMBOLS[axis]} (°)",
        frame=("reference", "experiment"),
    )


def _subtitle(flight: FlightComparison, axis: str) -> str:
    parts = []
    if flight.why is None:
        experiment = flight.experiment[axis].reported.peak_deg
        if np.isfinite(experiment):
            parts.append(f"peak: experiment {fixed(experiment, 1, '°')}")
        for m in flight.models:
            parts.append(f"{m.name} {_replay_peak(flight, m, axis)}")
        return _list(parts)
    window = flight.constant_angles.window_s if flight.constant_angles else np.nan
    for name, error in flight.predictions.items():
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
