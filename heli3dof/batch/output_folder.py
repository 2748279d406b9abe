"""`OutputFolder`: stores each outcome as it arrives, so that an interrupted batch can be resumed.

::

    OUT/results.parquet, results.csv   one row per task
    OUT/documents/NAME-KEY.json        what the verb (subcommand) prints with --json
    OUT/models/, OUT/recordings/       files that the verb writes
    OUT/journal.jsonl                  a line per outcome, as `journal_lines` yields it

An outcome's files are complete before its line is added to the journal. An incomplete line, left by
an interruption, is ignored, so its task runs again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Self

from filelock import FileLock, Timeout

from heli3dof.batch.task import Outcome
from heli3dof.errors import OutputExists, UsageError
from heli3dof.recording.atomic_write import new_folder, write_all, write_file
from heli3dof.write_errors import write_errors_explained

JOURNAL = "journal.jsonl"
RECORDINGS = "recordings"
RESUME = "another folder with -o; add --resume to continue in it when there is space"
Line = dict[str, Any]


def is_output_folder(folder: Path) -> bool:
    """Return True if a batch has written to the folder."""
    return (folder / JOURNAL).is_file()


class OutputFolder:
    """The output folder of a batch; a context manager that locks the folder for this process."""

    def __init__(self, path: Path, *, resume: bool) -> None:
        """Open or create the folder ``path``.

        Raises OutputExists if the folder has results of a batch, unless ``resume`` is true.
        """
        if is_output_folder(path) and not resume:
            raise OutputExists(
                f"{path} contains the results of a batch.",
                cause="an earlier batch wrote them.",
                fix="add --resume to do only what is missing, or choose another folder with -o",
            )
        if path.exists() and not path.is_dir():
            raise UsageError(
                f"{path} is a file, not a folder.", cause="-o names a folder.", fix="-o RESULTS"
            )
        self.path = new_folder(path)
        self._lock = FileLock(path / ".lock")

    def __enter__(self) -> Self:
        try:
            self._lock.acquire(timeout=0)
        except Timeout:
            raise UsageError(
                f"Another batch writes to {self.path}.",
                cause="it was started before and has not ended.",
                fix="wait for it, or choose another folder with -o",
            ) from None
        self.lines = {line["key"]: line for line in journal_lines(self.path)}
        """Task key → the last journal line of the task"""
        with write_errors_explained(self.path / JOURNAL, fix=RESUME):
            self._journal = (self.path / JOURNAL).open("ab", buffering=0)
            if _is_cut_off(self.path / JOURNAL):
                write_all(self._journal, b"\n")
        return self

    def __exit__(self, *error: object) -> None:
        self._journal.close()
        self._lock.release()

    def is_done(self, key: str) -> bool:
        """Return True if the task with this ``key`` has an outcome that no retry would change."""
        return key in self.lines and bool(self.lines[key]["final"])

    def add(self, outcome: Outcome, label: str) -> None:
        """Write an outcome to the folder; ``label``: name of its JSON document.

        Raises NoSpace if the disk is full; earlier outcomes are kept.
        """
        text = json.dumps(outcome.document, ensure_ascii=False, indent=1, allow_nan=False)
        document = f"documents/{label}.json"
        for name, content in (
            *outcome.files.items(), (document, text.encode("utf-8", "backslashreplace")),
        ):  # fmt: skip
            path = self.path / name
            with write_errors_explained(path, fix=RESUME):
                path.parent.mkdir(exist_ok=True)
            write_file(path, content, force=True)
        row = {**outcome.row, "document": document}
        line: Line = {
            "key": outcome.key, "final": outcome.is_final, "row": row, "cost": dict(outcome.cost),
        }  # fmt: skip
        text = json.dumps(line, ensure_ascii=False, allow_nan=False) + "\n"
        with write_errors_explained(self.path / JOURNAL, fix=RESUME):
            write_all(self._journal, text.encode("utf-8", "backslashreplace"))
        self.lines[outcome.key] = line


def journal_lines(folder: Path) -> Iterator[Line]:
    """Yield the complete lines of a batch's journal: dicts with fields of `Outcome`.

    The keys are ``key``, ``final``, ``row`` and ``cost``.
    """
    path = folder / JOURNAL
    if not path.exists():
        return
    with path.open("rb") as stream:
        for text in stream:
            try:
                line = json.loads(text)
            except ValueError:  # incomplete because of an interruption
                continue
            if isinstance(line, dict) and {"key", "final", "row", "cost"} <= line.keys():
                yield line


def _is_cut_off(path: Path) -> bool:
    """Return True if the last line of the journal is incomplete: it has no line break."""
    with path.open("rb") as stream:
        if not stream.seek(0, os.SEEK_END):
            return False
        stream.seek(-1, os.SEEK_END)
        return stream.read() != b"\n"
