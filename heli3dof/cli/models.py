"""``identify``: models from recordings."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from heli3dof.cli.console import Talk, verb
from heli3dof.cli.options import AsJson, Force, Output, ProfileFile, Quiet, Recordings


class Method(StrEnum):
    pem = "pem"
    pbsid = "pbsid"
    tf4 = "tf4"
    oe = "oe"


def register(app: typer.Typer) -> None:
    app.command("identify")(identify)


@verb
def identify(
    recordings: Recordings,
    method: Annotated[
        Method,
        typer.Option(help="pem: prediction error; pbsid: subspace; tf4: the paper's form; oe."),
    ] = Method.pem,
    order: Annotated[
        int | None, typer.Option("--order", help="Number of states; chosen when not given.")
    ] = None,
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="REC", help="Validate on this recording. Repeatable."),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="The model's name.")] = None,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE", help="Figures and tables, HTML.")
    ] = None,
    profile: ProfileFile = None,
    output: Output = None,
    force: Force = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Models from recordings: heli3dof identify rec.mcap -o model.json."""
    from heli3dof.cli.loading import load_all
    from heli3dof.identification.api import identify as fit
    from heli3dof.model.modelfile import save_model
    from heli3dof.recording.output import check_output
    from heli3dof.report.grid import to_rich
    from heli3dof.report.html import page as html_page
    from heli3dof.report.html import write_page
    from heli3dof.report.identification_section import (
        identification_section,
        identification_tables,
    )

    talk = Talk(as_json=as_json, quiet=quiet)
    path = output or Path(f"{recordings[0].name.split('.')[0]}-{method.value}.json")
    check_output(path, force=force)
    if report is not None:
        check_output(report, force=force)
    train = load_all(talk, recordings, profile)
    test = load_all(talk, holdout or [], profile)
    with talk.working(f"Identifying ({method.value}) from {len(train)} recording(s) …"):
        found = fit(train, method=method.value, order=order, holdout=test or None, name=name)
    save_model(found.model, path, force=force)
    if report is not None:
        names = ", ".join(r.name for r in train)
        title = f"Identification from {names}"
        write_page(html_page(title, "", [identification_section(found)]), report, force=force)
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
    talk.emit({"schema": "heli3dof.identification/1", "models": [found.to_json(str(path))]})
