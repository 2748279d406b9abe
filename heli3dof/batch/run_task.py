"""`run_task`: run one subcommand on one recording, in a worker process.

The subcommand writes its files to a temporary folder. If the recording comes from a URL, or was
sent with the task, `_local` also writes it to this folder. So the outcome (a JSON document and a
row of the results table) may contain temporary paths. `_replaced` replaces them:

- the temporary path of the recording by the path or URL that the user gave
- the temporary path of a written file by its path relative to the output folder
"""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from heli3dof.batch.analyses import ANALYSES, Job
from heli3dof.batch.condition import holds
from heli3dof.batch.recording_columns import COLUMNS, recording_columns
from heli3dof.batch.sources import Source
from heli3dof.batch.task import Outcome, Task, is_final
from heli3dof.errors import Heli3dofError, RecordingError, quoted
from heli3dof.file_kind import no_file
from heli3dof.json_values import jsonable
from heli3dof.recording.mcap_files.mcap_scan import refuse_stream

FAILURE = ("exit_code", "error", "cause", "fix")
"""Columns of every row that state how a verb ended; if it succeeded, the last three are empty"""


def run_task(task: Task) -> Outcome:
    """Return the outcome of a task; if it failed, its row has ``exit_code`` > 0 and ``error``."""
    wall, cpu = time.perf_counter(), time.process_time()
    with tempfile.TemporaryDirectory(prefix="heli3dof-") as folder:
        outcome = _replaced(_run(task, Path(folder)), folder, task.source)
    cost = {
        "wall_s": time.perf_counter() - wall,
        "cpu_s": time.process_time() - cpu,
        "sent_bytes": len(json.dumps(outcome.document)) + sum(map(len, outcome.files.values())),
    }
    return replace(outcome, cost={**outcome.cost, **cost})


def failed(task: Task, error: BaseException) -> Outcome:
    """Return the outcome of a task that ended with ``error``."""
    final = is_final(error)
    if not isinstance(error, Heli3dofError):
        error = Heli3dofError(
            f"{type(error).__name__}: {error}",
            cause="an internal error (a bug in heli3dof), or too little memory.",
            fix=f"heli3dof {task.verb} {quoted(task.source)}, and report the message",
        )
    ending = {
        "exit_code": error.exit_code, "error": error.what, "cause": error.cause, "fix": error.fix,
    }  # fmt: skip
    row = {**dict.fromkeys(COLUMNS), "recording": task.source, "name": task.name, **ending}
    document = {"schema": "heli3dof.error/1", **ending}
    return Outcome(task.key, row, document, is_final=final)


def _run(task: Task, folder: Path) -> Outcome:
    verb = ANALYSES[task.verb]
    columns: dict[str, Any] = {"recording": task.source or None, "name": task.name}
    read_bytes = 0.0
    try:
        path = _local(task, folder)
        read_bytes = float(path.stat().st_size) if path else 0.0
        job = Job(task, path, folder / "out")
        if task.source:
            recording = job.intact[0] if verb.accepts_torn else job.recording
            columns = recording_columns(recording, task.source)
            if task.where and not holds(task.where, columns):
                return Outcome(task.key, columns, {}, selected=False)
        document = verb.run(job)
        row = {**columns, **dict.fromkeys(FAILURE), "exit_code": 0, **verb.columns(document)}
        return Outcome(
            task.key, row, dict(document), _files(job.folder), cost={"read_bytes": read_bytes}
        )
    except Exception as error:
        outcome = failed(task, error)
        return replace(
            outcome, row={**outcome.row, **columns}, files=_files(folder / "out"),
            cost={"read_bytes": read_bytes},
        )  # fmt: skip


def _local(task: Task, folder: Path) -> Path | None:
    """Return a local path of the recording; None for a task without recording.

    The content of a URL, or content sent with the task, is written to ``folder`` first.
    """
    if not task.source:
        return None
    source = Source(task.source)
    if task.content is None and not source.is_url:
        path = Path(task.source)
        refuse_stream(path)
        if not path.is_file():
            raise no_file(path, "recording", RecordingError)
        return path
    path = folder / source.file_name
    path.write_bytes(source.read() if task.content is None else task.content)
    return path


def _files(folder: Path) -> dict[str, bytes]:
    """Return {path relative to ``folder``: content} of the files that a subcommand wrote there."""
    paths = sorted(p for p in folder.rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in paths}


def _replaced(outcome: Outcome, folder: str, source: str) -> Outcome:
    """Return the outcome in JSON types, without paths in the temporary ``folder``.

    The function makes paths of written files relative to the output folder. It replaces the
    recording's temporary path by ``source``, the path or URL that the user gave.
    """

    def text(value: str) -> str:
        value = value.replace(f"{folder}/out/", "")
        value = value.replace(f"{folder}/{Source(source).file_name}", source)
        return value.replace(folder, source.rpartition("/")[0] or ".")

    def each(value: Any) -> Any:
        if isinstance(value, str):
            return text(value) if folder in value else value
        if isinstance(value, Mapping):
            return {k: each(v) for k, v in value.items()}
        return [each(v) for v in value] if isinstance(value, (list, tuple)) else value

    return replace(
        outcome, row=each(jsonable(outcome.row)), document=each(jsonable(outcome.document))
    )
