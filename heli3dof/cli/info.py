"""``heli3dof info``: shows what a recording contains and how it was made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import typer

from heli3dof.cli.options import Columns, LogProfile, Recording, Verbose, log_profile
from heli3dof.cli.output import Output, verb
from heli3dof.errors import minus

if TYPE_CHECKING:
    from rich.table import Table

    from heli3dof.comparison.metrics import AxisMetrics

DETAILS = ("channels", "source", "started utc", "digest")
"""Names of the table's rows that only --verbose prints"""
WAY_DOWN = {"ramp": "ramp to zero", "at_once": "zero volts at once"}
MOST_STEPS = 6
"""Largest number of steps printed without --verbose, so that the output fits a screen"""


def register(app: typer.Typer) -> None:
    app.command("info", rich_help_panel="Files")(info)


@verb
def info(
    out: Output,
    recording: Recording,
    profile: LogProfile = None,
    columns: Columns = None,
    verbose: Verbose = False,
) -> None:
    """Show a recording: how the flight ended, ranges of angles and voltages, step responses.

    With --verbose, also show all steps, all channels, and whether the recording comes from a
    flight, a simulation or an import. In the JSON document, "steps" lists all steps of each axis.
    Example: heli3dof info rec.mcap
    """
    from heli3dof.comparison.document import steps_document
    from heli3dof.comparison.metrics import flight_metrics
    from heli3dof.recording.info import read_with_info

    flight, about = read_with_info(recording, log_profile(profile), columns)
    # Metrics need at least two samples, and time stamps that increase.
    metrics = flight_metrics(flight) if about["timing"] else {}
    out.warn(*about["warnings"])
    out.show(info_table(about, brief=not verbose))
    _show_steps(out, metrics, most=None if verbose else MOST_STEPS)
    if about["torn"]:
        out.warn(f"{about['damage']} The table is of the intact part. Try: {about['fix']}")
    steps = {axis: steps_document(m) for axis, m in metrics.items()}
    out.emit({"schema": "heli3dof.info/1", **about, "steps": steps})


def _show_steps(out: Output, metrics: Mapping[str, AxisMetrics], most: int | None) -> None:
    """Print a table of the references' steps, if any, with at most ``most`` rows (None: all)."""
    from heli3dof.report.text.comparison_tables import metrics_of

    stepped = {
        a: replace(m, steps=tuple(s for s in m.steps if s.kind in ("step", "start")))
        for a, m in metrics.items()
    }
    grid = metrics_of(stepped, "Steps of the reference")
    more = 0 if most is None else len(grid.rows) - most
    if more > 0:
        grid = replace(
            grid,
            rows=grid.rows[:most],
            notes=[*grid.notes, f"Steps not shown: {more}. All: --verbose"],
        )
    if grid.rows:
        out.show(grid)


def info_table(about: Mapping[str, Any], *, brief: bool = False) -> Table:
    """Return a table of a recording's `summary`; ``brief``: without the rows in `DETAILS`."""
    from rich.table import Table

    table = Table(show_header=False)
    for name, text in _rows(about):
        if not (brief and name in DETAILS):
            table.add_row(name, text)
    return table


def _rows(about: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    from heli3dof.cli.timing_summary import timing_rows

    timing, volts, source = about["timing"], about["voltage"], about["provenance"]
    yield "recording", about["name"]
    if about["outcome"]:
        detail = about["outcome_details"].get("detail", "")
        yield "outcome", f"{about['outcome']}{': ' if detail else ''}{detail}"
    if device_cause := about["outcome_details"].get("device_cause"):
        yield "device's cause", device_cause
    rate = f", {1 / timing['period_s']:.4g} Hz" if timing else ""
    start = minus(f", from {about['start_s']:g} s") if about["start_s"] else ""
    closed, way = about["closed_loop_s"], WAY_DOWN.get(about["way_down"])
    parts = f" ({closed:.2f} s in closed loop, then {way})" if way else ""
    yield "length", f"{about['duration_s']:.2f} s{parts}, {about['samples']} samples{rate}{start}"
    for axis, angle in about["angles"].items():
        reference = "" if angle["reference"] else ", reference not logged"
        if angle["min_deg"] is not None:
            seen = f"{angle['min_deg']:.2f}° to {angle['max_deg']:.2f}°"
            yield axis, f"{minus(seen)}{reference}"
    if volts["min_V"] is not None:
        yield "voltages", minus(f"{volts['min_V']:.2f} V to {volts['max_V']:.2f} V")
    known = "known" if about["loop_is_known"] else "unknown (no [controller] in the profile)"
    yield "profile", f"{about['profile']}; controller {known}"
    plan = about["plan"]
    if plan:
        yield "plan", plan["name"] if isinstance(plan, Mapping) else str(plan)
    seeds = {k: v for k, v in (about["seeds"] or {}).items() if v is not None}
    if seeds:
        yield "seed", ", ".join(f"{source_of} {seed}" for source_of, seed in seeds.items())
    yield from timing_rows(about)
    if about["channels"]:
        yield "channels", ", ".join(about["channels"])
    for key in ("source", "started_utc", "device"):
        if key in source:
            yield key.replace("_", " "), str(source[key])
    yield "digest", about["digest"][:16]
