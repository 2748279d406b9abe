"""``heli3dof batch VERB``: runs the subcommand VERB on many recordings; writes one table."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from heli3dof.cli import completion
from heli3dof.cli.options import (
    Cluster,
    LogProfile,
    ProfileFile,
    Quick,
    Seed,
    log_profile,
    rig_profile,
)
from heli3dof.cli.output import Output, add_family, live_allowed, verb
from heli3dof.errors import RecordingError, UsageError, quoted

if TYPE_CHECKING:
    from heli3dof.batch.bootstrap import NamedShare
    from heli3dof.batch.output_folder import OutputFolder
    from heli3dof.batch.run_batch import Batch
    from heli3dof.batch.task import Task
    from heli3dof.report.text.table import Grid

LINE_EVERY_S = 10.0
"""s, time between two lines of progress if there is no terminal (a convention)"""
Words = Annotated[
    list[str],
    typer.Argument(
        metavar="REC...",
        help="Recordings, folders, patterns ('term/**/*.mcap'), URLs (s3://…), a list.txt, or -.",
        autocompletion=completion.recordings,
    ),
]
Folder = Annotated[
    Path, typer.Option("-o", "--output", metavar="OUT", help="The folder of the results.")
]
Where = Annotated[
    str,
    typer.Option(
        "--where",
        metavar="CONDITION",
        help='Only recordings that meet this condition: \'rig="K1" and plan="rich"\'. Any of the '
        "table's first columns, see docs/how-to/many-recordings.md.",
    ),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="Continue in OUT: do only what is missing there.")
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", min=1, help="Number of processes; default: one per core."),
]


def register(app: typer.Typer) -> None:
    verbs = {f.__name__: f for f in (identify, diagnose, compare, info, recover, run)}
    help = "Run a subcommand on many recordings: one row of a table each."
    add_family(app, "batch", verbs, help=help, heading="Many recordings")


@verb
def identify(
    out: Output,
    recordings: Words,
    output: Folder,
    method: Annotated[str, typer.Option(help="As in heli3dof identify.")] = "greybox",
    order: Annotated[int | None, typer.Option("--order", help="Order of a black box.")] = None,
    terms: Annotated[
        str | None,
        typer.Option(
            "--terms",
            metavar="+A,-B",
            help="Effects of the grey box, as in heli3dof identify.",
            autocompletion=completion.terms,
        ),
    ] = None,
    where: Where = "",
    resume: Resume = False,
    workers: Workers = None,
    cluster: Cluster = None,
    profile: LogProfile = None,
) -> None:
    """Identify a model from each recording: heli3dof batch identify term-1/ -o OUT."""
    from heli3dof.identification.greybox.method import chosen_terms
    from heli3dof.identification.methods import known_method

    known_method(method)
    if terms is not None:
        chosen_terms(terms)
    options = [{"method": method, "order": order, "terms": terms}]
    _run(out, "identify", recordings, options, output, where, resume, workers, cluster, profile)


@verb
def diagnose(
    out: Output,
    recordings: Words,
    output: Folder,
    bootstrap: Annotated[
        int,
        typer.Option(
            "--bootstrap",
            metavar="N",
            min=0,
            help="Also diagnose N block bootstrap replicates of each recording, and count how "
            "often they name each cause.",
        ),
    ] = 0,
    quick: Quick = False,
    seed: Seed = 0,
    where: Where = "",
    resume: Resume = False,
    workers: Workers = None,
    cluster: Cluster = None,
    profile: LogProfile = None,
) -> None:
    """Diagnose each recording: heli3dof batch diagnose term-1/ -o OUT --quick."""
    options = [
        {"quick": quick, "seed": seed, "replicate": replicate} for replicate in range(bootstrap + 1)
    ]
    _run(out, "diagnose", recordings, options, output, where, resume, workers, cluster, profile)


@verb
def compare(
    out: Output,
    recordings: Words,
    output: Folder,
    model: Annotated[
        list[str] | None,
        typer.Option(
            "--model",
            metavar="M",
            help="hover …, or a model file. Repeatable; default: hover.",
            autocompletion=completion.models,
        ),
    ] = None,
    where: Where = "",
    resume: Resume = False,
    workers: Workers = None,
    cluster: Cluster = None,
    profile: LogProfile = None,
) -> None:
    """Compare models with each recording: heli3dof batch compare term-1/ -o OUT --model m.json."""
    from heli3dof.batch.analyses import model_texts

    options = [{"models": model_texts(model or ["hover"])}]
    _run(out, "compare", recordings, options, output, where, resume, workers, cluster, profile)


@verb
def info(
    out: Output,
    recordings: Words,
    output: Folder,
    where: Where = "",
    resume: Resume = False,
    workers: Workers = None,
    cluster: Cluster = None,
    profile: LogProfile = None,
) -> None:
    """List what each recording contains: heli3dof batch info term-1/ -o OUT."""
    _run(out, "info", recordings, [{}], output, where, resume, workers, cluster, profile)


@verb
def recover(
    out: Output,
    recordings: Words,
    output: Folder,
    where: Where = "",
    resume: Resume = False,
    workers: Workers = None,
    cluster: Cluster = None,
) -> None:
    """Copy the intact part of each incomplete recording: heli3dof batch recover term-1/ -o OUT."""
    _run(out, "recover", recordings, [{}], output, where, resume, workers, cluster, None)


@verb
def run(
    out: Output,
    sweep: Annotated[
        Path,
        typer.Option(
            "--sweep", metavar="FILE.toml", help="The flights: docs/how-to/many-recordings.md"
        ),
    ],
    output: Folder,
    resume: Resume = False,
    workers: Workers = None,
    cluster: Cluster = None,
    profile: ProfileFile = None,
) -> None:
    """Fly many emulated rigs: heli3dof batch run --sweep sweep.toml -o OUT."""
    from heli3dof.batch.sweep import tasks_of_sweep

    tasks = tasks_of_sweep(sweep, rig_profile(profile).with_controller())
    run_tasks(tasks, output, resume, workers, cluster, out)


def _run(
    out: Output, name: str, words: Sequence[str], options: Sequence[Mapping[str, Any]],
    output: Path, where: str, resume: bool, workers: int | None, cluster: str | None,
    profile: Path | None,
) -> None:  # fmt: skip
    """Run the subcommand ``name`` on many recordings, and print the results.

    ``words``: the command-line arguments that name the recordings (files, folders, patterns, URLs).
    ``options``: one or more sets of options of the subcommand. The subcommand runs on each
    recording once with each set. ``where``: a condition that selects recordings; "" selects all.
    """
    from heli3dof.batch.condition import checked
    from heli3dof.batch.recording_columns import COLUMNS
    from heli3dof.batch.run_batch import tasks_of
    from heli3dof.batch.sources import find

    used = log_profile(profile)
    condition = checked(where, COLUMNS) if where else ""
    sources = find(words)
    files = [Path(source.where) for source in sources if not source.is_url]
    folders = [*map(Path, words), *(file.parent for file in files)]
    if not resume and output.resolve() in [folder.resolve() for folder in folders]:
        raise UsageError(
            f"{output} is the folder of the recordings.",
            cause="-o names the folder of the results, which would mix with the recordings.",
            fix=f"-o {quoted(f'{output.resolve().name}-{name}')}",
        )
    with out.working(f"Reading {len(sources)} recordings …"):
        tasks = list(tasks_of(name, sources, options, used, condition))
    run_tasks(tasks, output, resume, workers, cluster, out)


def run_tasks(
    tasks: Sequence[Task], output: Path, resume: bool, workers: int | None, cluster: str | None,
    out: Output,
) -> None:  # fmt: skip
    """Do the tasks of a batch with a progress display, and print how many succeeded and failed."""
    from heli3dof.batch.engines import engine
    from heli3dof.batch.output_folder import OutputFolder
    from heli3dof.batch.run_batch import run_batch

    name = tasks[0].verb
    if cluster and workers is not None:
        raise UsageError(
            "--workers and --cluster exclude each other.",
            cause="a cluster has its own number of workers.",
            fix="leave one of the two out; DASK_SCHEDULER_ADDRESS counts as --cluster",
        )
    with (
        OutputFolder(output, resume=resume) as folder,
        engine(cluster, workers) as used,
        _progress(out, name) as progress,
    ):
        batch = run_batch(tasks, folder, used, progress)
        shares = _named_shares(tasks, folder) if name == "diagnose" else {}
    _show(out, name, batch, output, shares)
    if batch.failed and batch.failed == batch.total - batch.left_out:
        raise typer.Exit(RecordingError.exit_code)


def _named_shares(tasks: Sequence[Task], folder: OutputFolder) -> dict[str, list[NamedShare]]:
    """Return how often the diagnoses of a recording's bootstrap replicates name each cause.

    The result is a dict: recording → one `NamedShare` for each cause. Recordings without replicates
    are left out.
    """
    from heli3dof.batch.bootstrap import named_shares

    rows: dict[str, list[Mapping[str, Any]]] = {}
    for task in tasks:
        if task.key in folder.lines:
            rows.setdefault(task.source, []).append(folder.lines[task.key]["row"])
    shares = {source: named_shares(each) for source, each in rows.items()}
    return {source: each for source, each in shares.items() if each}


def _show(
    out: Output, name: str, batch: Batch, output: Path, shares: Mapping[str, Sequence[NamedShare]]
) -> None:
    done = batch.total - batch.left_out
    sentence = f"{name}: {done - batch.failed} of {done} recordings done"
    if batch.failed:
        sentence += f", {batch.failed} failed (column error of the table)"
    if batch.left_out:
        sentence += f"; {batch.left_out} others do not meet the condition"
    out.show(f"{sentence}.")
    if batch.failed:
        out.show(f"The first failure: {batch.first_failure}")
    for recording, each in shares.items():
        out.show(_share_table(recording, each))
    out.note(*(f"Table: {table}" for table in batch.tables))
    out.emit(
        {
            "schema": "heli3dof.batch/1",
            "verb": name,
            "folder": str(output),
            "tables": [str(t) for t in batch.tables],
            "recordings": batch.total,
            "kept": batch.kept,
            "left_out": batch.left_out,
            "failed": batch.failed,
            "bootstrap": {r: [s.to_dict() for s in each] for r, each in shares.items()},
        }
    )


def _share_table(recording: str, shares: Sequence[NamedShare]) -> Grid:
    from heli3dof.report.text.table import Grid

    rows = [
        (
            s.cause,
            "yes" if s.in_recording else "no",
            f"{100 * s.share:.0f} %",
            "{:.0f} to {:.0f} %".format(*(100 * x for x in s.interval)),
        )
        for s in shares
    ]
    title = f"{recording}: share of {shares[0].of} bootstrap replicates that name the cause"
    return Grid(title, ("cause", "named in the recording", "replicates", "95 % interval"), rows)


@contextmanager
def _progress(out: Output, name: str) -> Iterator[Callable[[Batch], None]]:
    """Context manager: yields a function that displays progress and time left of batch ``name``."""
    if out.quiet or not live_allowed():
        start = printed_at = time.monotonic()

        def print_line(batch: Batch) -> None:
            nonlocal printed_at
            now = time.monotonic()
            if now - printed_at >= LINE_EVERY_S and batch.done:
                printed_at = now
                left_min = (now - start) / batch.done * batch.left / 60
                done = f"{batch.kept + batch.done} of {batch.total}"
                out.note(f"{name}: {done}, {left_min:.1f} min left")

        yield print_line
        return
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeRemainingColumn,
    )

    with Progress(
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn(),
        console=out.err, transient=True,
    ) as bars:  # fmt: skip
        bar = bars.add_task(name, total=None)

        def update(batch: Batch) -> None:
            bars.update(bar, total=batch.total - batch.kept, completed=batch.done)

        yield update
