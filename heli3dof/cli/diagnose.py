"""``diagnose``: what the simulation gets wrong, the cause, the extended model, the gain."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli.options import AsJson, Force, LogProfile, Output, Quiet, Recordings, Seed
from heli3dof.cli.output import Talk, live_allowed, verb

if TYPE_CHECKING:
    from heli3dof.diagnosis.integrity import Fault
    from heli3dof.diagnosis.result import Diagnosis
    from heli3dof.recording.recording import Recording

BAD_DATA = 5
"""Exit code of a recording that is itself at fault; its document is printed all the same."""


class Base(StrEnum):
    rigid = "rigid"
    hover = "hover"


def register(app: typer.Typer) -> None:
    app.command("diagnose")(diagnose)


@verb
def diagnose(
    recordings: Recordings,
    holdout: Annotated[
        list[Path] | None,
        typer.Option("--holdout", metavar="REC", help="Measure the gain on this. Repeatable."),
    ] = None,
    base: Annotated[
        Base, typer.Option("--base", help="The simulation that is judged: rigid body, or hover.")
    ] = Base.rigid,
    quick: Annotated[
        bool, typer.Option("--quick", help="A first look: fewer nulls, no blocks left out.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE", help="Figures and tables, HTML.")
    ] = None,
    profile: LogProfile = None,
    output: Output = None,
    force: Force = False,
    seed: Seed = 0,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """What the simulation gets wrong, and why: heli3dof diagnose rec.mcap -o model.json."""
    from heli3dof.cli.inputs import distinct, one_rig
    from heli3dof.diagnosis.diagnose import diagnose as find
    from heli3dof.diagnosis.document import document as to_document
    from heli3dof.diagnosis.next_experiment import next_of
    from heli3dof.diagnosis.result import Diagnosis
    from heli3dof.model.model_file import save_model
    from heli3dof.recording.atomic_write import check_outputs, ours, stem
    from heli3dof.report.diagnosis_page import diagnosis_page
    from heli3dof.report.html import write_page

    talk = Talk(as_json=as_json, quiet=quiet)
    name = Path(f"{stem(recordings[0])}-extended.json")
    given = [*recordings, *(holdout or [])]
    check_outputs(output or ours(name, force=force), report, force=force, inputs=given)
    train, at_fault = read(talk, recordings, profile)
    test, also = read(talk, holdout or [], profile)
    if at_fault or also:
        names = [[stem(p) for p in side] for side in (recordings, holdout or [])]
        refused = Diagnosis((*names[0],), (*names[1],), "bad_data", (*at_fault, *also))
        document = to_document(refused)
        show(talk, document)
        complain(talk, refused)
        talk.emit(document)
        raise typer.Exit(BAD_DATA)
    distinct(train, test)
    one_rig([*train, *test])
    with saying(talk) as says:
        found = find(train, test or None, quick=quick, seed=seed, says=says, base=base.value)
        written = None
        if found.fitted is not None:
            path = output or ours(name, force=force)
            written = str(save_model(found.fitted.model, path, force=force))
        upcoming = None
        if found.fitted is not None and not quick:
            says("Simulating what to fly next …")
            upcoming = next_of(found, seed=seed)
    document = to_document(found, written, upcoming)
    show(talk, document)
    if written is not None:
        talk.note(f"Model: {written}")
    if report is not None:
        with talk.working("Drawing the report …"):
            write_page(diagnosis_page(found, document, train, test), report, force=force)
        talk.note(f"Report: {report}")
    elif found.fitted is not None:
        talk.note("Pictures, and Table II before and after: add --report FILE.html")
    talk.emit(document)
    if found.verdict == "bad_data":
        complain(talk, found)
        raise typer.Exit(BAD_DATA)


def show(talk: Talk, document: Mapping[str, Any]) -> None:
    """The document's tables and sentences."""
    from heli3dof.report.diagnosis_tables import diagnosis_tables
    from heli3dof.report.text_table import Grid, to_rich

    for each in diagnosis_tables(document):
        talk.show(to_rich(each) if isinstance(each, Grid) else each)


def complain(talk: Talk, found: Diagnosis) -> None:
    """What is wrong with the recordings, a line each, where nothing else was printed."""
    if talk.quiet:
        for fault in found.faults:
            fix = f" Try: {fault.fix}" if fault.fix else ""
            talk.fail(f"{fault.recording}: {fault.sentence}{fix}")


def read(
    talk: Talk, paths: Sequence[Path], profile: Path | None
) -> tuple[list[Recording], list[Fault]]:
    """The recordings, and what is wrong with logs of other programs that cannot be taken as one.

    Such a log is bad data like any other: radians under the name of degrees, say. A file that is
    missing, or a torn recording of ours, is an error.
    """
    from heli3dof.cli.inputs import load_all
    from heli3dof.diagnosis.integrity import Fault, Kind
    from heli3dof.errors import RecordingError
    from heli3dof.recording.atomic_write import stem
    from heli3dof.recording.logs.import_log import is_log

    loaded: list[Recording] = []
    faults: list[Fault] = []
    for path in paths:
        try:
            loaded += load_all(talk, [path], profile)
        except RecordingError as e:
            if not path.is_file() or not is_log(path):
                raise
            name = stem(path)
            refused = Fault("log.refused", Kind.BAD_DATA, name, e.what, e.cause, e.fix)
            faults += exchanged(path, profile) or [refused]
    return loaded, faults


def exchanged(path: Path, profile: Path | None) -> list[Fault]:
    """Two columns named for each other in a log that was refused: angles in volts are no degrees
    either."""
    from heli3dof.diagnosis.integrity import integrity
    from heli3dof.errors import RecordingError
    from heli3dof.recording.logs.import_log import import_log
    from heli3dof.rig.profile import default_profile, load_profile

    chosen = load_profile(profile) if profile else default_profile()
    try:
        found = integrity(import_log(path, chosen, believed=False))
    except RecordingError:
        return []
    return [f for f in found if f.check == "columns.swapped"]


@contextmanager
def saying(talk: Talk) -> Iterator[Callable[[str], None]]:
    """What is being done: one line that changes on a terminal, a line for each stage elsewhere.

    What stands behind the stage's "…" is how far it has come: a log file does not want that.
    """
    if talk.quiet or not live_allowed():
        yield lambda sentence: None if "… " in sentence else talk.note(sentence)
        return
    with talk.err.status("Reading …") as status:
        yield status.update
