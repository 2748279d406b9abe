"""``compare``: Table II and Figures 7–9, for any mix of recordings and models."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.options import AsJson, Force, ProfileFile, Quiet
from heli3dof.cli.output import Talk, verb

if TYPE_CHECKING:
    from heli3dof.comparison.compare import Comparison
    from heli3dof.model.base import Model
    from heli3dof.recording.recording import Recording


def register(app: typer.Typer) -> None:
    app.command("compare")(compare)


@verb
def compare(
    what: Annotated[
        list[str] | None,
        typer.Argument(metavar="[REC... MODEL...]", help="Recordings; model files or names."),
    ] = None,
    profile: ProfileFile = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Where the figures go."),
    ] = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Models against the experiment; with no argument, on the recordings that ship."""
    from heli3dof.cli.inputs import load_all, models_for, split, with_shipped
    from heli3dof.comparison.compare import compare as against
    from heli3dof.comparison.document import to_json
    from heli3dof.model.linear.hover import hover_model
    from heli3dof.paper.reproduction import reproduce
    from heli3dof.recording.atomic_write import check_folder, check_outputs
    from heli3dof.report.comparison_tables import comparison_renderables
    from heli3dof.rig.profile import default_profile

    talk = Talk(as_json=as_json, quiet=quiet)
    folder = output or Path("comparisons") / datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
    check_folder(folder)
    if what:
        paths, names = split(what)
        recordings = load_all(talk, paths, profile)
        identified: list[Model] = []
        if not names:
            names = ["hover"]
            talk.note("No model was named: the hover model is compared alone.")
    else:
        names = ["hover"]
        with talk.working("Identifying from the recordings that ship …"):
            recordings, identified = with_shipped()

    if folder.exists():
        check_outputs(*figure_paths(recordings, folder), force=force)

    def models(recording: Recording) -> list[Model]:
        return [*models_for(names, recording), *identified]

    with talk.working("Comparing …"):
        found = against(recordings, models)
        figures = write_figures(found, folder, force=force)
    published = reproduce(hover_model(default_profile()))
    talk.show(*comparison_renderables(found, published))
    for warning in found.warnings:
        talk.warn(warning)
    talk.note(f"Figures: {folder}")
    talk.emit({**to_json(found, published), "figures": [str(f) for f in figures]})


ENDINGS = ("svg", "png")


def figure_paths(recordings: Sequence[Recording], folder: Path) -> list[Path]:
    """The files that `write_figures` makes."""
    return [folder / f"{r.name}-{a}.{e}" for r in recordings for a in r.axes for e in ENDINGS]


def write_figures(found: Comparison, folder: Path, *, force: bool) -> list[Path]:
    """Figures 7–9 of every recording, SVG and PNG; returns their paths."""
    from heli3dof.recording.atomic_write import new_folder
    from heli3dof.report.figure_style import save
    from heli3dof.report.figures import axis_figures

    new_folder(folder)
    written = []
    for flight in found.flights:
        for name, figure in axis_figures(flight).items():
            for ending in ENDINGS:
                path = folder / f"{flight.recording.name}-{name}.{ending}"
                written.append(save(figure, path, force=force))
    return written
