"""What is said at the end of a flight: peak, overshoot, error per axis, late periods."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from heli3dof.axes import AXES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rich.table import Table

    from heli3dof.comparison.metrics import AxisMetrics
    from heli3dof.experiment.fly import Flight
    from heli3dof.recording.recording import Recording

COLUMNS = {
    "set_deg": ("set", "°"),
    "peak_deg": ("peak", "°"),
    "overshoot_deg": ("overshoot", "°"),
    "steady_error_deg": ("steady error", "°"),
    "rise_time_s": ("rise", " s"),
    "settling_time_s": ("settling", " s"),
}


def metrics_of(recording: Recording) -> Mapping[str, AxisMetrics]:
    """Step metrics of what the controller flew (the ramp to zero left out)."""
    from heli3dof.comparison.metrics import flight_metrics
    from heli3dof.comparison.replay import under_control

    flown = under_control(recording)
    grain = recording.profile.encoder.rad_per_count
    return flight_metrics(flown.t, flown.angle, flown.reference, resolution=grain)


def recording_table(recording: Recording, title: str, caption: str | None = None) -> Table:
    """A rich table of step metrics, a row per axis."""
    from rich.table import Table

    table = Table(title=title, caption=caption)
    table.add_column("axis")
    for heading, _ in COLUMNS.values():
        table.add_column(heading, justify="right")
    for axis, metrics in metrics_of(recording).items():
        values = [getattr(metrics.reported, name) for name in COLUMNS]
        units = [unit for _, unit in COLUMNS.values()]
        table.add_row(
            axis, *(f"{v:.2f}{u}" if v == v else "–" for v, u in zip(values, units, strict=True))
        )
    return table


def recording_document(recording: Recording) -> dict[str, Any]:
    """The step metrics of each axis, as JSON keys with units."""
    found = metrics_of(recording)
    return {
        axis: {"set_deg": found[axis].reported.set_deg, **found[axis].reported.values()}
        for axis in AXES
    }


def flight_table(flight: Flight) -> Table | str:
    """The metrics, how the flight ended, and how punctual the loop was."""
    outcome = flight.outcome
    if not outcome.periods:
        return f"Nothing was flown: {outcome.detail}"
    seconds = outcome.periods * flight.recording.profile.dt
    return recording_table(
        flight.recording,
        f"{flight.recording.name}: {outcome.ending}, {seconds:.1f} s in closed loop",
        f"late by more than 1 ms: {outcome.late} of {outcome.periods} periods"
        + (f"; {outcome.missed} missed" if outcome.missed else ""),
    )


def flight_document(flight: Flight) -> dict[str, Any]:
    """``run-step --json`` and ``run --json``."""
    outcome = flight.outcome
    return {
        "schema": "heli3dof.flight/1",
        "recording": str(flight.path),
        "outcome": outcome.ending,
        "detail": outcome.detail,
        "periods": outcome.periods,
        "late_periods": outcome.late,
        "missed_periods": outcome.missed,
        "worst_lateness_s": outcome.worst_lateness_s,
        "landed": outcome.landed,
        "digest": flight.recording.digest,
        "axes": recording_document(flight.recording) if outcome.periods else {},
    }
