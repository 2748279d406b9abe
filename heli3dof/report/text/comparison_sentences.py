"""Write the sentences of a comparison: peak of roll, RMSE over the flight, prediction errors."""

from __future__ import annotations

import numpy as np

from heli3dof.axes import AXES, ROLL
from heli3dof.comparison.result import FlightComparison, ModelComparison
from heli3dof.report.text.number_format import fixed


def comparison_text(flight: FlightComparison) -> str:
    """Return sentences on the errors of each model with one recording."""
    if not flight.models:
        return "No model was compared."
    if flight.why is None:
        peak = flight.experiment["roll"].reported.peak_deg
        sentences = [f"{flight.recording.name}: roll peaks at {fixed(peak, 1, '°')}."]
        sentences += [replay_sentence(flight, m) for m in flight.models]
        return " ".join([*sentences, prediction_sentence(flight)])
    title = f"{flight.recording.name}, {_window(flight)}"
    return f"{title}: " + " ".join(_window_errors(flight, m) for m in flight.models)


def model_sentence(flight: FlightComparison, m: ModelComparison) -> str:
    """Return a sentence on the error of one model with one recording."""
    if flight.why is None:
        return replay_sentence(flight, m)
    return f"{_window(flight)}: {_window_errors(flight, m)}"


def _window(flight: FlightComparison) -> str:
    window = flight.constant_angles.window_s if flight.constant_angles else 0.0
    return f"RMSE of predictions over {window:g} s"


def _window_errors(flight: FlightComparison, m: ModelComparison) -> str:
    if m.prediction is None:
        return f"{m.name}: none."
    errors = [
        f"{fixed(m.prediction.over_window_deg[AXES.index(a)], 1, '°')} in {a}"
        for a in flight.flown.axes
    ]
    return f"{m.name}: {', '.join(errors)}."


def replay_sentence(flight: FlightComparison, m: ModelComparison) -> str:
    """Return a sentence on one model's replay: its peak of roll, its RMSE over the flight."""
    if m.diverged_at_s is not None:
        return f"{m.name} diverges at {m.diverged_at_s:.1f} s."
    if m.metrics is None or m.replay_rmse_deg is None:
        return f"{m.name} was not replayed."
    difference = flight.difference(m, "roll")["peak_deg"]
    rmse = ", ".join(fixed(v, 2, "°") for v in m.replay_rmse_deg)
    error = f"RMSE over the flight is {rmse} in roll, pitch, yaw."
    if not np.isfinite(difference):
        return f"{m.name}'s {error}"
    apart = f"{fixed(abs(difference), 1, '°')} {'higher' if difference > 0 else 'lower'}"
    peak = apart if abs(difference) >= 0.05 else "at the same height"
    return f"{m.name}'s roll peaks {peak}; its {error}"


def prediction_sentence(flight: FlightComparison) -> str:
    """Return a sentence with each model's RMSE of roll predictions; empty without predictions."""
    if flight.constant_angles is None:
        return ""
    errors = [
        f"{fixed(p.over_window_deg[ROLL], 1, '°')} ({name})"
        for name, p in flight.predictions.items()
        if p is not None
    ]
    window = flight.constant_angles.window_s
    return f"RMSE of roll predictions over {window:g} s: {', '.join(errors)}."
