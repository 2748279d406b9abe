"""``heli3dof plot``: draws recorded flights, one figure for each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.options import Force, LogProfile, Recordings
from heli3dof.cli.output import Output, verb

ENDING = ".png"


def register(app: typer.Typer) -> None:
    app.command("plot", rich_help_panel="Files")(plot)


@verb
def plot(
    out: Output,
    recordings: Recordings,
    profile: LogProfile = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="File of the figure: .png, .svg or .pdf. With several recordings, the command "
            "writes one file for each, and adds the recording's name to FILE.",
        ),
    ] = None,
    force: Force = False,
) -> None:
    """Draw angles, references and voltages over time: heli3dof plot rec.mcap -o flight.svg."""
    from heli3dof.cli.inputs import load_all
    from heli3dof.recording.atomic_write import check_outputs, default_output, stem
    from heli3dof.report.figures.flight import flight_figure
    from heli3dof.report.figures.style import check_ending, save

    if output is None:
        paths = [default_output(Path(f"{stem(r)}{ENDING}"), force=force) for r in recordings]
    elif len(recordings) == 1:
        paths = [output]
    else:
        paths = [output.with_name(f"{output.stem}-{stem(r)}{output.suffix}") for r in recordings]
    for path in paths:
        check_ending(path)
    check_outputs(*paths, force=force, inputs=recordings)
    loaded = load_all(out, recordings, profile)
    with out.working("Drawing …"):
        for recording, path in zip(loaded, paths, strict=True):
            save(flight_figure(recording), path, force=force)
    out.note(*(f"Figure: {path}" for path in paths))
    out.emit({"schema": "heli3dof.plot/1", "figures": [str(p) for p in paths]})
