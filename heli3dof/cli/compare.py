"""``heli3dof compare``: compares models with flights, in tables and the paper's Figures 7–9."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli import completion
from heli3dof.cli.options import Force, PaperNumbers, ProfileFile, Verbose
from heli3dof.cli.output import Output, verb

if TYPE_CHECKING:
    from heli3dof.comparison.compare import Comparison
    from heli3dof.model.base import Model
    from heli3dof.paper.reproduction import Reproduced
    from heli3dof.recording.recording import Recording

FORMATS = ("svg", "png")


def register(app: typer.Typer) -> None:
    app.command("compare", rich_help_panel="Model")(compare)


@verb
def compare(
    out: Output,
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[REC... MODEL...]",
            help="Recordings; model files or names.",
            autocompletion=completion.recordings_and_models,
        ),
    ] = None,
    profile: ProfileFile = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="The folder of the figures."),
    ] = None,
    identify_controller: Annotated[
        bool,
        typer.Option(
            "--identify-controller",
            help="If a log's profile has no controller, identify it from the log, and simulate "
            "the flight in closed loop with it.",
        ),
    ] = False,
    paper: PaperNumbers = False,
    force: Force = False,
    verbose: Verbose = False,
) -> None:
    """Compare models with flights; default: the recordings that come with heli3dof.

    Example: heli3dof compare rec.mcap hover model.json
    """
    from heli3dof.cli.inputs import are_supplied, load_all, models_for, reference_comparison, split
    from heli3dof.comparison.compare import compare
    from heli3dof.comparison.document import comparison_document
    from heli3dof.model.linear.hover import hover_model
    from heli3dof.paper.reproduction import reproduce
    from heli3dof.recording.atomic_write import check_folder, check_outputs
    from heli3dof.rig.profile import default_profile

    folder = output or Path("comparisons") / datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    check_folder(folder)
    names: list[str] = []
    identified: list[Model] = []
    if words:
        paths, names = split(words)
        recordings = load_all(out, paths, profile)
        if not names:
            out.note("No model was given: only the hover model is compared.")
    else:
        with out.working("Identifying models from the recordings that come with heli3dof …"):
            recordings, identified = reference_comparison()
    names = names or ["hover"]
    if folder.exists():
        files = (_figure_path(folder, r, a, e) for r in recordings for a in r.axes for e in FORMATS)
        check_outputs(*files, force=force)

    def models(recording: Recording) -> list[Model]:
        return [*models_for(names, recording), *identified]

    with out.working("Comparing …"):
        comparison = compare(recordings, models, identify_controller=identify_controller)
        figures = write_figures(comparison, folder, force=force)
    published = reproduce(hover_model(default_profile()))
    supplied = are_supplied(recordings)
    shown = published if paper or (verbose and supplied) else ()
    show_comparison(out, comparison, shown, paper=paper or supplied, verbose=verbose)
    out.warn(*comparison.warnings)
    unknown = [r for r in recordings if r.profile.controller is None]
    if not identify_controller and any(r.has_reference(a) for r in unknown for a in r.axes):
        out.note("To replay logs without [controller] in closed loop, add --identify-controller")
    out.note(f"Figures: {folder}")
    if not verbose:
        out.note("For step metrics and all horizons add --verbose")
    out.emit({**comparison_document(comparison, published), "figures": [str(f) for f in figures]})


def show_comparison(
    out: Output,
    comparison: Comparison,
    published: Sequence[Reproduced] = (),
    *,
    paper: bool = False,
    verbose: bool = False,
) -> None:
    """Print each axis's best model and a table of RMSE values; with ``verbose`` all tables.

    ``paper``: True prints also a table like the paper's Table II. ``published``: the paper's
    numbers; if there are any, they are printed as one more table.
    """
    from heli3dof.comparison.verdict import verdict
    from heli3dof.report.text.comparison_tables import (
        comparison_grids,
        comparison_summary,
        published_table,
    )

    lines = comparison_summary(comparison, paper=paper)
    if verbose:
        lines = [*verdict(comparison), *comparison_grids(comparison, paper=paper)]
    if published:
        lines.append(published_table(published))
    out.show(*lines)


def _figure_path(folder: Path, recording: Recording, axis: str, ending: str) -> Path:
    from heli3dof.recording.atomic_write import file_name

    return folder / f"{file_name(recording.name)}-{axis}.{ending}"


def write_figures(comparison: Comparison, folder: Path, *, force: bool) -> list[Path]:
    """Write the paper's Figures 7–9 for each recording into ``folder``; return the files' paths.

    Each measured angle gives one figure, as SVG and as PNG. Raises OutputExists if a file exists,
    unless ``force`` is true.
    """
    from heli3dof.recording.atomic_write import new_folder
    from heli3dof.report.figures.comparison import axis_figures
    from heli3dof.report.figures.style import save

    new_folder(folder)
    return [
        save(figure, _figure_path(folder, flight.recording, axis, ending), force=force)
        for flight in comparison.flights
        for axis, figure in axis_figures(flight).items()
        for ending in FORMATS
    ]
