"""`run_batch`: distribute tasks, store their outcomes, and write the results table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from heli3dof.batch.engines.base import Engine, Lost
from heli3dof.batch.output_folder import OutputFolder
from heli3dof.batch.results_table import write_table
from heli3dof.batch.run_task import failed, run_task
from heli3dof.batch.sources import Source
from heli3dof.batch.task import Outcome, Task
from heli3dof.errors import Heli3dofError
from heli3dof.rig.profile import Profile

Progress = Callable[["Batch"], None]


@dataclass
class Batch:
    """The progress of a batch: how many of its tasks are done, failed or left out."""

    total: int
    """Number of all tasks; a task is a recording, a bootstrap replicate, or a flight of a sweep."""
    kept: int = 0
    """Tasks that this run skips: an earlier run finished them, or they equal another task"""
    done: int = 0
    """Tasks that this run has completed, including those in ``left_out``"""
    failed: int = 0
    """Tasks of this and earlier runs whose verb failed"""
    left_out: int = 0
    """Tasks whose recording does not meet the condition ``--where``"""
    first_failure: str = ""
    """Name and error message of the first failed task"""
    tables: Sequence[Path] = ()

    @property
    def left(self) -> int:
        return self.total - self.kept - self.done


def tasks_of(
    verb: str, sources: Sequence[Source], options: Sequence[Mapping[str, Any]],
    profile: Profile | None, where: str,
) -> Iterator[Task]:  # fmt: skip
    """Yield a task for each pair of a recording in ``sources`` and a set of options in ``options``.

    ``profile`` and ``where``: as in `Task`.
    """
    for source in sources:
        fingerprint = source.fingerprint()
        for each in options:
            yield Task.new(
                verb, source.name, each, profile, source=source.where, fingerprint=fingerprint,
                where=where,
            )  # fmt: skip


def run_batch(
    tasks: Sequence[Task], folder: OutputFolder, engine: Engine,
    progress: Progress = lambda batch: None,
) -> Batch:  # fmt: skip
    """Run the tasks that have no final outcome in ``folder``; return the `Batch`.

    ``progress`` is called at the start and after each outcome. At the end, or after Ctrl-C or an
    error, the function writes the results table: a row for each of the ``tasks`` with an outcome,
    in their order.
    """
    # Two files of the same name and content are one task.
    todo = list({t.key: t for t in tasks if not folder.is_done(t.key)}.values())
    batch = Batch(len(tasks), kept=len(tasks) - len(todo))
    progress(batch)
    sent = (_with_content(t) if engine.remote else t for t in todo)
    try:
        with closing(engine.run(run_task, sent)) as outcomes:
            for n, result in outcomes:
                outcome = _lost(todo[n], result) if isinstance(result, Lost) else result
                batch.done += 1
                if outcome.selected:
                    folder.add(outcome, todo[n].label)
                else:
                    batch.left_out += 1
                progress(batch)
    finally:
        rows = [_row(task, folder) for task in tasks if task.key in folder.lines]
        failures = [row for row in rows if row["exit_code"] != 0]
        batch.failed = len(failures)
        if failures:
            first, error = failures[0], str(failures[0]["error"])
            name = str(first.get("name") or first.get("recording") or "")
            batch.first_failure = error if name in error else f"{name}: {error}"
        batch.tables = write_table(rows, folder.path) if rows else ()
    return batch


def _row(task: Task, folder: OutputFolder) -> Mapping[str, Any]:
    row: Mapping[str, Any] = folder.lines[task.key]["row"]
    return {**row, "recording": task.source} if task.source else row


def _with_content(task: Task) -> Task:
    """Return the task with its file's content; unchanged for a URL and an unreadable file."""
    source = Source(task.source)
    if not task.source or source.is_url:
        return task
    try:
        return replace(task, content=source.read())
    except Heli3dofError:
        return task  # the worker states that there is no such file


def _lost(task: Task, lost: Lost) -> Outcome:
    error = Heli3dofError(
        f"There is no result: {lost.why}.",
        cause="the memory was full, or somebody ended the worker.",
        fix="the same command with --resume and fewer --workers",
    )
    return failed(task, error)
