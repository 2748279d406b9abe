"""``heli3dof report``: writes one self-contained HTML file about recordings and models."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli import completion
from heli3dof.cli.options import Force, LogProfile, OutputFile, PaperNumbers, Recordings
from heli3dof.cli.output import Output, verb


def register(app: typer.Typer) -> None:
    app.command("report", rich_help_panel="Model")(report)


@verb
def report(
    out: Output,
    recordings: Recordings,
    models: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            metavar="M",
            help="A model's name or file. Repeatable.",
            autocompletion=completion.models,
        ),
    ] = None,
    profile: LogProfile = None,
    output: OutputFile = None,
    paper: PaperNumbers = False,
    force: Force = False,
) -> None:
    """Write one self-contained HTML file: heli3dof report rec.mcap --model model.json."""
    from heli3dof.cli.inputs import are_supplied, load_all, models_for
    from heli3dof.comparison.compare import compare
    from heli3dof.comparison.verdict import verdict
    from heli3dof.model.linear.hover import hover_model
    from heli3dof.paper.reproduction import reproduce
    from heli3dof.recording.atomic_write import check_ending, check_outputs, default_output, stem
    from heli3dof.report.pages.flight_report import flight_report
    from heli3dof.report.pages.html import write_page
    from heli3dof.rig.profile import default_profile

    path = output or default_output(Path(f"{stem(recordings[0])}-report.html"), force=force)
    check_outputs(path, force=force, inputs=recordings)
    check_ending(path, ".html")
    loaded = load_all(out, recordings, profile)
    names = models or ["hover"]
    paper = paper or are_supplied(loaded)
    with out.working("Comparing and drawing …"):
        comparison = compare(loaded, lambda recording: models_for(names, recording))
        text = flight_report(
            loaded,
            models=models_for(names, loaded[0]),
            comparison=comparison,
            reproduced=reproduce(hover_model(default_profile())) if paper else (),
        )
    write_page(text, path, force=force)
    out.show(*verdict(comparison))
    out.note(f"Report: {path}")
    out.emit({"schema": "heli3dof.report/1", "report": str(path), "warnings": comparison.warnings})
