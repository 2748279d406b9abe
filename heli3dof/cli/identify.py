"""``heli3dof identify``: identifies a model from recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli import completion
from heli3dof.cli.options import (
    Force,
    Holdout,
    LogProfile,
    OutputFile,
    Recordings,
    ReportFile,
    Verbose,
)
from heli3dof.cli.output import Output, stages, verb

if TYPE_CHECKING:
    from heli3dof.identification.identify import Identification
    from heli3dof.recording.recording import Recording


def register(app: typer.Typer) -> None:
    app.command("identify", rich_help_panel="Model")(identify)


@verb
def identify(
    out: Output,
    recordings: Recordings,
    method: Annotated[
        str,
        typer.Option(
            help="Physical: greybox (maximum likelihood), freeflight (3 s predictions). Black "
            "boxes: pem, pbsid, oe. The paper's transfer functions: tf4. Installed packages may "
            "add methods."
        ),
    ] = "greybox",
    order: Annotated[
        int | None, typer.Option("--order", help="Order of a black box; default: selected.")
    ] = None,
    terms: Annotated[
        str | None,
        typer.Option(
            "--terms",
            metavar="+A,-B",
            help="Effects of the grey box: +A,-B adds A to the default terms and removes B; A,B "
            "fits only these. Example: --terms +friction.coulomb.yaw,-bias.torque.pitch. "
            "docs/reference/effects.md lists the names.",
            autocompletion=completion.terms,
        ),
    ] = None,
    holdout: Holdout = None,
    name: Annotated[str | None, typer.Option("--name", help="The model's name.")] = None,
    report: ReportFile = None,
    profile: LogProfile = None,
    output: OutputFile = None,
    force: Force = False,
    verbose: Verbose = False,
) -> None:
    """Identify a model from recordings: heli3dof identify rec.mcap -o model.json."""
    from heli3dof.cli.inputs import load_all, refuse_bad_data
    from heli3dof.identification.identify import identify
    from heli3dof.model.model_file import save_model
    from heli3dof.recording.atomic_write import check_ending, check_outputs, default_output, stem

    path = output or default_output(Path(f"{stem(recordings[0])}-{method}.json"), force=force)
    check_outputs(path, report, force=force, inputs=[*recordings, *(holdout or [])])
    check_ending(path, ".json")
    if report is not None:
        check_ending(report, ".html")
    train = load_all(out, recordings, profile)
    test = load_all(out, holdout or [], profile)
    with stages(out) as stage:
        stage("Checking the recordings …")
        refuse_bad_data([*train, *test])
        result = identify(
            train,
            method=method,
            order=order,
            terms=terms,
            holdout=test or None,
            name=name,
            progress=stage,
        )
    save_model(result.model, path, force=force)
    if report is not None:
        with out.working("Drawing the report …"):
            _write_report(result, train, test, report, force=force)
    _show(out, result, verbose=verbose)
    out.note(f"Model: {path}")
    if report is not None:
        out.note(f"Report: {report}")
    elif not verbose:
        out.note("For all tables add --verbose, for figures --report FILE.html")
    out.emit({"schema": "heli3dof.identification/1", "models": [result.to_dict(str(path))]})


def _show(out: Output, result: Identification, *, verbose: bool) -> None:
    """Print an identification: its summary, or with ``verbose`` all sentences and tables."""
    from heli3dof.report.text.identification_tables import (
        identification_summary,
        identification_tables,
    )

    warnings = list(result.warnings)
    if verbose:
        out.show(*(s for s in result.sentences() if not s.startswith("Warning: ")))
        out.show(*identification_tables(result))
    else:
        out.show(*identification_summary(result))
        vague = {n: p.verdict for n, p in result.found.parameters.items() if p.verdict}
        if len(vague) > 1:
            warnings = [w for w in warnings if w not in vague.values()]
            warnings.append(
                f"{len(vague)} parameters are not identifiable from these recordings: "
                f"{', '.join(vague)}. More: --verbose"
            )
    out.warn(*warnings)


def _write_report(
    result: Identification,
    train: Sequence[Recording],
    test: Sequence[Recording],
    path: Path,
    *,
    force: bool,
) -> None:
    """Write a report on a model identified from ``train``; compare it with ``test``, if any."""
    from heli3dof.comparison.compare import compare
    from heli3dof.paper.models import load_model
    from heli3dof.report.pages.flight_report import flight_report
    from heli3dof.report.pages.html import write_page

    title = f"Identification from {', '.join(r.name for r in train)}"
    models = [load_model("hover", train[0].profile), result.model]
    text = flight_report(
        test or train,
        models=models,
        comparison=compare(test, models) if test else None,
        identified=[result],
        title=title,
    )
    write_page(text, path, force=force)
