"""Summarise a flight as a table and as JSON: step-response metrics, outcome and timing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from heli3dof.axes import AXES
from heli3dof.cli.timing_summary import timing_note

if TYPE_CHECKING:
    from heli3dof.experiment.fly import Flight
    from heli3dof.recording.recording import Recording
    from heli3dof.report.text.table import Grid


def recording_table(recording: Recording, title: str, note: str | None = None) -> Grid:
    """Return a table to print: step metrics by step and axis, with a ``title`` and a ``note``.

    The metrics leave out the ramp of the voltages to zero at the flight's end.
    """
    from heli3dof.comparison.metrics import flight_metrics
    from heli3dof.report.text.comparison_tables import metrics_of

    grid = metrics_of(flight_metrics(recording), title)
    return replace(grid, notes=[*grid.notes, note]) if note else grid


def recording_document(recording: Recording) -> dict[str, Any]:
    """Return, by axis name, the reference (°) and metrics of one segment, for JSON.

    The segment is the first step of the axis's reference. `heli3dof.comparison.metrics` defines the
    segment of an axis without a step.
    """
    from heli3dof.comparison.metrics import flight_metrics

    metrics = flight_metrics(recording)
    return {
        axis: {"set_deg": metrics[axis].reported.set_deg, **metrics[axis].reported.values()}
        for axis in AXES
    }


def flight_table(flight: Flight) -> Grid | str:
    """Return a table of a flight, or a sentence if it ended before its first control period."""
    from heli3dof.recording.info import closed_loop_s

    outcome = flight.outcome
    if not outcome.periods:
        return "Nothing was flown."
    seconds = closed_loop_s(flight.recording) or 0.0
    return recording_table(
        flight.recording,
        f"{flight.recording.name}: {outcome.ending}, {seconds:.1f} s in closed loop",
        timing_note(outcome, len(flight.recording)),
    )


def flight_document(flight: Flight) -> dict[str, Any]:
    """Return a flight's JSON document, which ``run --json`` and ``run-step --json`` print."""
    from heli3dof.recording.info import flight_warnings

    outcome = flight.outcome
    details = outcome.details()
    return {
        "schema": "heli3dof.flight/1",
        "recording": str(flight.path),
        "outcome": outcome.ending,
        "detail": outcome.detail,
        **outcome.advice(),
        "device_cause": outcome.device_cause,
        "samples": len(flight.recording),
        "periods": outcome.periods,
        "late_periods": outcome.late,
        "missed_periods": outcome.missed,
        "lost_periods": outcome.lost,
        "left_out_periods": outcome.device_skipped,
        "worst_lateness_s": outcome.worst_lateness_s,
        "punctuality": details["punctuality"],
        "realtime": details["realtime"],
        "link": details["link"],
        "latency": details["latency"],
        "warnings": flight_warnings(flight.recording),
        "landed": outcome.landed,
        "ramped": outcome.ramped,
        "digest": flight.recording.digest,
        "axes": recording_document(flight.recording) if outcome.periods else {},
    }
