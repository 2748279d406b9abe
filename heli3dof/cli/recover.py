"""``heli3dof recover``: copies the intact part of a damaged recording to a new file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.options import Force, OutputFile
from heli3dof.cli.output import Output, verb


def register(app: typer.Typer) -> None:
    app.command("recover", rich_help_panel="Files")(recover)


@verb
def recover(
    out: Output,
    recording: Annotated[Path, typer.Argument(metavar="REC", help="An incomplete recording.")],
    output: OutputFile = None,
    force: Force = False,
) -> None:
    """Copy the intact part of an incomplete recording to a new file; the original is unchanged.

    Example: heli3dof recover torn.mcap -o whole.mcap
    """
    from heli3dof.recording.mcap_files.recover import recover

    saved = recover(recording, output, force=force)
    out.show(f"Recovered {saved.samples} samples, {saved.seconds:.2f} s.")
    if saved.chunks_damaged or saved.bytes_lost:
        out.warn(
            f"lost: {saved.chunks_damaged} damaged chunk{'s' * (saved.chunks_damaged != 1)} "
            f"and {saved.bytes_lost} unreadable bytes"
        )
    out.warn(*saved.warnings)
    out.note(f"Recording: {saved.path}")
    out.emit({"schema": "heli3dof.recovery/1", **saved.document()})
