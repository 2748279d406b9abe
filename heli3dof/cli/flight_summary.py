"""Summarise a flight as a table and as JSON: step-response metrics, outcome and timing."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from heli3dof.axes import AXES
from heli3dof.cli.timing_summary import timing_note

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.console import Group

    from heli3dof.comparison.metrics import AxisMetrics
    from heli3dof.experiment.fly import Flight
    from heli3dof.recording.recording import Recording


def metrics_of(recording: Recording) -> Mapping[str, AxisMetrics]:
    """Return the step-response metrics by axis, without the ramp to zero at the flight's end."""
    from heli3dof.comparison.metrics import flight_metrics

    return flight_metrics(recording)


def recording_table(recording: Recording, title: str, note: str | None = None) -> Group:
    """Return the table of step-response metrics, with a row for each step of each axis."""
    from heli3dof.report.comparison_tables import metrics_of as metrics_grid
    from heli3dof.report.text_table import to_rich

    grid = metrics_grid(metrics_of(recording), title)
    return to_rich(replace(grid, notes=[*grid.notes, note]) if note else grid)


def recording_document(recording: Recording) -> dict[str, Any]:
    """Return the metrics of one step response per axis, as a dict with units in its keys."""
    metrics = metrics_of(recording)
    return {
        axis: {"set_deg": metrics[axis].reported.set_deg, **metrics[axis].reported.values()}
        for axis in AXES
    }


def flight_table(flight: Flight) -> Group | str:
    """Return the table of a flight: step-response metrics, outcome, and the loop's timing."""
    outcome = flight.outcome
    if not outcome.periods:
        return f"Nothing was flown: {outcome.detail}"
    seconds = outcome.periods * flight.recording.profile.dt
    return recording_table(
        flight.recording,
        f"{flight.recording.name}: {outcome.ending}, {seconds:.1f} s in closed loop",
        timing_note(outcome),
    )


def flight_warnings(flight: Flight) -> list[str]:
    """Return warnings about the link to the rig and about encoders that did not change."""
    from heli3dof.recording.link_quality import link_warnings
    from heli3dof.recording.still_encoder import still_encoder_warnings

    recording = flight.recording
    return [
        *link_warnings(flight.outcome.details(), recording.profile.dt),
        *still_encoder_warnings(recording),
    ]


def flight_document(flight: Flight) -> dict[str, Any]:
    """Return the dictionary that ``run-step --json`` and ``run --json`` print."""
    outcome = flight.outcome
    details = outcome.details()
    return {
        "schema": "heli3dof.flight/1",
        "recording": str(flight.path),
        "outcome": outcome.ending,
        "detail": outcome.detail,
        **outcome.advice(),
        "device_cause": outcome.device_cause,
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
        "warnings": flight_warnings(flight),
        "landed": outcome.landed,
        "ramped": outcome.ramped,
        "digest": flight.recording.digest,
        "axes": recording_document(flight.recording) if outcome.periods else {},
    }
