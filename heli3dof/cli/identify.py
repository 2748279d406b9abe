"""``identify``: models from recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.options import AsJson, Force, LogProfile, Output, Quiet, Recordings
from heli3dof.cli.output import Talk, verb
from heli3dof.identification.methods import built_in

if TYPE_CHECKING:
    from heli3dof.identification.identify import Identification
    from heli3dof.recording.recording import Recording


PHYSICAL = [m.name for m in built_in().values() if m.physical]
BLACK_BOXES = [m.name for m in built_in().values() if not m.physical]


def register(app: typer.Typer) -> None:
    app.command("identify")(identify)


@verb
def identify(
    recordings: Recordings,
    method: Annotated[
        str,
        typer.Option(
            metavar=f"<{'|'.join([*PHYSICAL, *BLACK_BOXES])}>",
            help=f"{', '.join(PHYSICAL)}: physical parameters; {', '.join(BLACK_BOXES)}: black "
            "boxes.",
        ),
    ] = "greybox",
    order: Annotated[
        int | None, typer.Option("--order", help="States of a black box; chosen when not given.")
    ] = None,
    terms: Annotated[
        str | None,
        typer.Option("--terms", metavar="+A,-B", help="Effects to add to or leave out of greybox."),
    ] = None,
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="REC", help="Validate on this recording. Repeatable."),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="The model's name.")] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE", help="Figures and tables, HTML.")
    ] = None,
    profile: LogProfile = None,
    output: Output = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Models from recordings: heli3dof identify rec.mcap -o model.json."""
    from heli3dof.cli.inputs import distinct, load_all, one_rig
    from heli3dof.identification.greybox.method import chosen_terms
    from heli3dof.identification.identify import identify as fit
    from heli3dof.model.model_file import save_model
    from heli3dof.recording.atomic_write import check_outputs, ours, stem
    from heli3dof.report.identification_section import identification_tables
    from heli3dof.report.text_table import to_rich

    talk = Talk(as_json=as_json, quiet=quiet)
    path = output or ours(Path(f"{stem(recordings[0])}-{method}.json"), force=force)
    check_outputs(path, report, force=force, inputs=[*recordings, *(holdout or [])])
    train = load_all(talk, recordings, profile)
    test = load_all(talk, holdout or [], profile)
    distinct(train, test)
    one_rig([*train, *test])
    with talk.working(f"Identifying ({method}) from {len(train)} recording(s) …"):
        found = fit(
            train,
            method=method,
            order=order,
            terms=None if terms is None else chosen_terms(terms),
            holdout=test or None,
            name=name,
        )
    save_model(found.model, path, force=force)
    if report is not None:
        with talk.working("Drawing the report …"):
            _write_report(found, train, test, report, force=force)
    for sentence in found.sentences():
        if not sentence.startswith("Warning: "):
            talk.show(sentence)
    talk.show(*(to_rich(grid) for grid in identification_tables(found)))
    if found.found.transfer is not None:
        talk.show("\n".join(found.transfer.lines()))
    for warning in found.warnings:
        talk.warn(warning)
    talk.note(f"Model: {path}")
    if report is not None:
        talk.note(f"Report: {report}")
    talk.emit({"schema": "heli3dof.identification/1", "models": [found.to_dict(str(path))]})


def _write_report(
    found: Identification,
    train: Sequence[Recording],
    test: Sequence[Recording],
    path: Path,
    *,
    force: bool,
) -> None:
    """The identification's section; with held-out recordings, how the model does on them too."""
    from heli3dof.comparison.compare import compare
    from heli3dof.paper.models import load_model
    from heli3dof.report.flight_report import flight_report
    from heli3dof.report.html import page, write_page
    from heli3dof.report.identification_section import identification_section

    title = f"Identification from {', '.join(r.name for r in train)}"
    section = identification_section(found)
    if not test:
        write_page(page(title, "", [section]), path, force=force)
        return
    models = [load_model("hover", test[0].profile), found.model]
    compared = compare(test, models)
    text = flight_report(test, models=models, comparison=compared, extra=[section], title=title)
    write_page(text, path, force=force)
