"""``heli3dof export``: writes a recording as CSV, MAT or Parquet."""

from __future__ import annotations

import typer

from heli3dof.cli.options import (
    AsJson,
    Columns,
    Force,
    LogProfile,
    OutputFile,
    Quiet,
    Recording,
    log_profile,
)
from heli3dof.cli.output import Output, verb


def register(app: typer.Typer) -> None:
    app.command("export", rich_help_panel="Files")(export)


@verb
def export(
    recording: Recording,
    output: OutputFile = None,
    profile: LogProfile = None,
    columns: Columns = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Write a recording as CSV, MAT or Parquet: heli3dof export REC -o REC.csv."""
    from heli3dof.recording.atomic_write import check_outputs
    from heli3dof.recording.load import load
    from heli3dof.recording.logs.export import check_format, export

    out = Output(as_json=as_json, quiet=quiet)
    path = output or recording.with_suffix(".csv")
    if recording.exists():
        check_format(path)
        check_outputs(path, force=force, inputs=[recording])
    loaded = load(recording, log_profile(profile), columns)
    written = export(loaded, path, force=force)
    out.note(f"Written: {written}, {len(loaded)} samples")
    out.emit({"schema": "heli3dof.export/1", "file": str(written), "samples": len(loaded)})
