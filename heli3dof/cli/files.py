"""Verbs on files: ``import``, ``export``, ``info``, ``recover``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from heli3dof.cli.options import AsJson, Force, LogProfile, Output, Quiet
from heli3dof.cli.output import Talk, verb

Columns = Annotated[
    str | None,
    typer.Option("--columns", metavar="A,B,...", help="Names of a MAT matrix's rows or columns."),
]


def register(app: typer.Typer) -> None:
    app.command("import")(import_)
    app.command("export")(export)
    app.command("info")(info)
    app.command("recover")(recover)


@verb
def import_(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="A .csv, .csv.gz or .mat log.")],
    profile: LogProfile = None,
    output: Output = None,
    columns: Columns = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Make a recording of a log: heli3dof import LOG --profile P -o REC."""
    from heli3dof.errors import UsageError
    from heli3dof.recording.atomic_write import check_outputs, stem
    from heli3dof.recording.info import summary
    from heli3dof.recording.logs.import_log import import_log, is_log
    from heli3dof.recording.write import write_recording
    from heli3dof.rig.profile import load_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    if profile is None and is_log(log) and log.exists():
        raise UsageError(
            f"{log} is a log, and a log does not say which rig it is from.",
            cause="no profile was named.",
            fix=f"heli3dof import {log} --profile PROFILE.toml -o REC.mcap",
        )
    if output is None:
        output = Path(f"{stem(log)}.mcap")
    if log.exists():  # which is the first thing to say
        check_outputs(output, force=force, inputs=[log])
    recording = import_log(log, load_profile(profile) if profile else None, columns)
    write_recording(recording, output, force=force)
    for warning in recording.meta.get("warnings", ()):
        talk.warn(warning)
    about = summary(recording)
    talk.show(_info_table(about))
    talk.note(f"Recording: {output}")
    talk.emit({"schema": "heli3dof.info/1", "file": str(output), **about})


@verb
def export(
    recording: Annotated[Path, typer.Argument(metavar="REC", help="A recording or a log.")],
    output: Output = None,
    profile: LogProfile = None,
    columns: Columns = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a recording as CSV, MAT or Parquet: heli3dof export REC -o REC.csv."""
    from heli3dof.recording.atomic_write import check_outputs
    from heli3dof.recording.load import load
    from heli3dof.recording.logs.export import check_format
    from heli3dof.recording.logs.export import export as write
    from heli3dof.rig.profile import load_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    output = output or recording.with_suffix(".csv")
    if recording.exists():
        check_format(output)
        check_outputs(output, force=force, inputs=[recording])
    loaded = load(recording, load_profile(profile) if profile else None, columns)
    path = write(loaded, output, force=force)
    talk.note(f"Written: {path}, {len(loaded)} samples")
    talk.emit({"schema": "heli3dof.export/1", "file": str(path), "samples": len(loaded)})


@verb
def info(
    recording: Annotated[Path, typer.Argument(metavar="REC", help="A recording or a log.")],
    profile: LogProfile = None,
    columns: Columns = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Say what is in a recording, and where it came from."""
    from heli3dof.recording.info import file_info
    from heli3dof.rig.profile import load_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    about = file_info(recording, load_profile(profile) if profile else None, columns)
    for warning in about["warnings"]:
        talk.warn(warning)
    talk.show(_info_table(about))
    if about["torn"]:
        talk.warn(f"the file is torn; bring the rest back with: {about['fix']}")
    talk.emit({"schema": "heli3dof.info/1", **about})


@verb
def recover(
    recording: Annotated[Path, typer.Argument(metavar="REC", help="A torn recording.")],
    output: Output = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Salvage a torn recording into a new file; the original is left as it is."""
    from heli3dof.recording.mcap_files.recover import recover as salvage

    talk = Talk(as_json=as_json, quiet=quiet)
    saved = salvage(recording, output, force=force)
    talk.show(f"Brought back {saved.samples} samples, {saved.seconds:.2f} s.")
    if saved.chunks_damaged:
        talk.warn(f"{saved.chunks_damaged} damaged chunks were left out")
    talk.note(f"Recording: {saved.path}")
    talk.emit(
        {
            "schema": "heli3dof.recovery/1",
            "file": str(saved.path),
            "samples": saved.samples,
            "duration_s": saved.seconds,
            "bytes_lost": saved.bytes_lost,
            "chunks_damaged": saved.chunks_damaged,
        }
    )


def _info_table(about: Mapping[str, Any]) -> Any:
    from rich.table import Table

    from heli3dof.cli.timing_summary import punctuality_rows

    table = Table(show_header=False)
    timing, volts = about["timing"], about["voltage"]
    table.add_row("recording", about["name"])
    rate = f", {1 / timing['period_s']:.4g} Hz" if timing else ""
    table.add_row("length", f"{about['duration_s']:.2f} s, {about['samples']} samples{rate}")
    for axis, angle in about["angles"].items():
        reference = "" if angle["reference"] else ", reference not logged"
        if angle["min_deg"] is not None:
            table.add_row(axis, f"{angle['min_deg']:.2f}° to {angle['max_deg']:.2f}°{reference}")
    if volts["min_V"] is not None:
        table.add_row("voltages", f"{volts['min_V']:.2f} V to {volts['max_V']:.2f} V")
    known = "known" if about["loop_is_known"] else "unknown (the profile names no controller)"
    table.add_row("profile", f"{about['profile']}; its loop is {known}")
    for what, said in punctuality_rows(about):
        table.add_row(what, said)
    plan = about["plan"]
    if plan:
        table.add_row("plan", plan["name"] if isinstance(plan, Mapping) else str(plan))
    drawn = {k: v for k, v in (about["seeds"] or {}).items() if v is not None}
    if drawn:
        table.add_row("seed", ", ".join(f"{who} {seed}" for who, seed in drawn.items()))
    if about["outcome"]:
        detail = about["outcome_details"].get("detail", "")
        table.add_row("outcome", f"{about['outcome']}{': ' if detail else ''}{detail}")
    if stated := about["outcome_details"].get("device_cause"):
        table.add_row("device's cause", stated)
    if about["channels"]:
        table.add_row("channels", ", ".join(about["channels"]))
    source = about["provenance"]
    for key in ("source", "started_utc", "device"):
        if key in source:
            table.add_row(key.replace("_", " "), str(source[key]))
    table.add_row("digest", about["digest"][:16])
    return table
