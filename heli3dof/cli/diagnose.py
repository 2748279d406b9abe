"""``heli3dof diagnose``: finds the causes of a simulation's error and extends the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from heli3dof.cli.options import (
    Cluster,
    Force,
    Holdout,
    LogProfile,
    OutputFile,
    Quick,
    Recordings,
    ReportFile,
    Seed,
    Verbose,
    rig_profile,
)
from heli3dof.cli.output import Output, stages, verb
from heli3dof.errors import RecordingError

if TYPE_CHECKING:
    from heli3dof.integrity import Fault
    from heli3dof.recording.recording import Recording


class Base(StrEnum):
    rigid = "rigid"
    hover = "hover"


def register(app: typer.Typer) -> None:
    app.command("diagnose", rich_help_panel="Model")(diagnose)


@verb
def diagnose(
    out: Output,
    recordings: Recordings,
    holdout: Holdout = None,
    base: Annotated[
        Base,
        typer.Option("--base", help="The simulation to diagnose: rigid body, or linear hover."),
    ] = Base.rigid,
    quick: Quick = False,
    cluster: Cluster = None,
    report: ReportFile = None,
    profile: LogProfile = None,
    output: OutputFile = None,
    force: Force = False,
    seed: Seed = 0,
    verbose: Verbose = False,
) -> None:
    """Find the causes of the simulation's error: heli3dof diagnose rec.mcap -o model.json."""
    from heli3dof.batch.engines.replications import replications_on_cluster
    from heli3dof.diagnosis.diagnose import diagnose
    from heli3dof.diagnosis.document import diagnosis_document as to_document
    from heli3dof.diagnosis.planning.next_experiment import next_experiment
    from heli3dof.diagnosis.result import Diagnosis
    from heli3dof.model.model_file import model_bytes
    from heli3dof.recording.atomic_write import (
        check_ending,
        check_outputs,
        default_output,
        stem,
        write_file,
    )
    from heli3dof.report.pages.flight_report import diagnosis_page
    from heli3dof.report.pages.html import write_page

    name = Path(f"{stem(recordings[0])}-extended.json")
    inputs = [*recordings, *(holdout or [])]
    check_outputs(output or default_output(name, force=force), report, force=force, inputs=inputs)
    check_ending(output or name, ".json")
    if report is not None:
        check_ending(report, ".html")
    train, faults = _load(out, recordings, profile)
    test, test_faults = _load(out, holdout or [], profile)
    if faults or test_faults:
        names = tuple(map(stem, recordings)), tuple(map(stem, holdout or []))
        document = to_document(Diagnosis(*names, "bad_data", (*faults, *test_faults)))
        show_diagnosis(out, document, verbose=verbose)
        out.emit(document)
        _end_with_bad_data(out, document)
    written = upcoming = None
    with stages(out) as stage, replications_on_cluster(cluster):
        result = diagnose(
            train, test or None, quick=quick, seed=seed, progress=stage, base=base.value
        )
        if result.fitted is not None:
            data = model_bytes(result.fitted.model)
            path = output or default_output(name, force=force, data=data)
            if output is not None or force or not path.exists():  # else it holds the same model
                write_file(path, data, force=force)
            written = str(path)
            if not quick:
                stage("Simulating candidates for the next flight …")
                upcoming = next_experiment(result, seed=seed)
    document = to_document(result, written, upcoming)
    show_diagnosis(out, document, verbose=verbose)
    if written is not None:
        out.note(f"Model: {written}")
    if report is not None:
        with out.working("Drawing the report …"):
            write_page(diagnosis_page(result, document, train, test), report, force=force)
        out.note(f"Report: {report}")
    elif result.fitted is not None and not verbose:
        out.note("For all tables add --verbose, for figures --report FILE.html")
    out.emit(document)
    if result.verdict == "bad_data":
        _end_with_bad_data(out, document)


def show_diagnosis(out: Output, document: Mapping[str, Any], *, verbose: bool = False) -> None:
    """Print a summary of a diagnosis; with ``verbose``, print all tables instead.

    ``document``: the JSON document of ``diagnose --json``.
    """
    from heli3dof.report.text.diagnosis_summary import diagnosis_summary
    from heli3dof.report.text.diagnosis_tables import diagnosis_tables

    out.show(*(diagnosis_tables(document) if verbose else diagnosis_summary(document)))


def _end_with_bad_data(out: Output, document: Mapping[str, Any]) -> NoReturn:
    """End the command with the exit code of RecordingError, because a recording has faults.

    With ``--quiet`` no report has shown these faults, so the function prints them first.
    ``document``: the diagnosis, which contains the faults.
    """
    from heli3dof.report.text.diagnosis_summary import faults

    if out.quiet:
        out.fail(*faults(document))
    raise typer.Exit(RecordingError.exit_code)


def _load(
    out: Output, paths: Sequence[Path], profile: Path | None
) -> tuple[list[Recording], list[Fault]]:
    """Return the recordings that can be read, and a fault for each log that cannot be imported.

    Such a log has, for example, radians in a column named degrees; the diagnosis reports it as bad
    data. A missing file or a damaged recording raises RecordingError.
    """
    from heli3dof.cli.inputs import load_all
    from heli3dof.integrity import Fault, Kind
    from heli3dof.recording.atomic_write import stem
    from heli3dof.recording.logs.import_log import is_log

    loaded: list[Recording] = []
    faults: list[Fault] = []
    for path in paths:
        try:
            loaded += load_all(out, [path], profile)
        except RecordingError as e:
            if not path.is_file() or not is_log(path):
                raise
            refused = Fault("log.refused", Kind.BAD_DATA, stem(path), e.what, e.cause, e.fix)
            faults += _swapped_columns(path, profile) or [refused]
    return loaded, faults


def _swapped_columns(path: Path, profile: Path | None) -> list[Fault]:
    """Check the log at ``path`` for two swapped columns; return the fault found, if any, in a list.

    The list is also empty if the log cannot be imported.
    """
    from heli3dof.integrity import integrity
    from heli3dof.recording.logs.import_log import import_log

    used = rig_profile(profile)
    try:
        faults = integrity(import_log(path, used, check_values=False))
    except RecordingError:
        return []
    return [f for f in faults if f.check == "columns.swapped"]
