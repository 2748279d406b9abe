"""``heli3dof import``: converts a CSV or MAT log to a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.options import AsJson, Columns, Force, LogProfile, OutputFile, Quiet, rig_profile
from heli3dof.cli.output import Output, verb


def register(app: typer.Typer) -> None:
    app.command("import", rich_help_panel="Files")(import_log)


@verb
def import_log(
    log: Annotated[
        Path,
        typer.Argument(
            metavar="LOG",
            help="A .csv, .csv.gz, .mat or .mcap log, or a format of an installed package.",
        ),
    ],
    profile: LogProfile = None,
    output: OutputFile = None,
    columns: Columns = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Convert a CSV or MAT log to a recording: heli3dof import LOG --profile P -o REC."""
    from heli3dof.cli.info import info_table
    from heli3dof.errors import UsageError
    from heli3dof.recording.atomic_write import check_outputs, stem
    from heli3dof.recording.info import summary
    from heli3dof.recording.logs.import_log import import_log, is_log
    from heli3dof.recording.write import write_recording

    out = Output(as_json=as_json, quiet=quiet)
    if profile is None and is_log(log) and log.exists():
        raise UsageError(
            f"{log} is a log, and a log does not contain the profile of its rig.",
            cause="--profile is missing.",
            fix=f"heli3dof import {log} --profile PROFILE.toml -o REC.mcap",
        )
    path = output or Path(f"{stem(log)}.mcap")
    if log.exists():  # a missing log is reported first
        check_outputs(path, force=force, inputs=[log])
    recording = import_log(log, rig_profile(profile), columns)
    write_recording(recording, path, force=force)
    for warning in recording.meta.get("warnings", ()):
        out.warn(warning)
    about = summary(recording)
    out.show(info_table(about))
    out.note(f"Recording: {path}")
    out.emit({"schema": "heli3dof.info/1", "file": str(path), **about})
