"""``heli3dof info``: shows what a recording contains and how it was made."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from heli3dof.cli.options import AsJson, Columns, LogProfile, Quiet, Recording, log_profile
from heli3dof.cli.output import Output, verb

if TYPE_CHECKING:
    from rich.table import Table


def register(app: typer.Typer) -> None:
    app.command("info", rich_help_panel="Files")(info)


@verb
def info(
    recording: Recording,
    profile: LogProfile = None,
    columns: Columns = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show what a recording contains: how the flight ended, angles, timing, profile, source.

    Example: heli3dof info rec.mcap
    """
    from heli3dof.recording.info import file_info

    out = Output(as_json=as_json, quiet=quiet)
    about = file_info(recording, log_profile(profile), columns)
    for warning in about["warnings"]:
        out.warn(warning)
    out.show(info_table(about))
    if about["torn"]:
        out.warn(f"the file is incomplete; recover the rest with: {about['fix']}")
    out.emit({"schema": "heli3dof.info/1", **about})


def info_table(about: Mapping[str, Any]) -> Table:
    """Return a table to print of ``about``, a recording's `heli3dof.recording.info.summary`."""
    from rich.table import Table

    table = Table(show_header=False)
    for row in _rows(about):
        table.add_row(*row)
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
    yield "length", f"{about['duration_s']:.2f} s, {about['samples']} samples{rate}"
    for axis, angle in about["angles"].items():
        reference = "" if angle["reference"] else ", reference not logged"
        if angle["min_deg"] is not None:
            yield axis, f"{angle['min_deg']:.2f}° to {angle['max_deg']:.2f}°{reference}"
    if volts["min_V"] is not None:
        yield "voltages", f"{volts['min_V']:.2f} V to {volts['max_V']:.2f} V"
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
