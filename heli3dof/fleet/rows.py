"""Rows of a batch: one dict per recording, with the columns of ``results.csv``."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from heli3dof.errors import RecordingError, UsageError

RESULTS = "results.csv"
TEXTS = ("recording", "name", "rig", "started_utc", "plan", "outcome", "verb", "error", "faults")
"""Columns that stay text; in the others, numbers are converted"""
NEEDED = ("recording", "rig", "exit_code")


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of ``results.csv`` in a batch's folder; an empty cell is None.

    Raises UsageError if the file is missing, RecordingError if it cannot be used.
    """
    path = folder / RESULTS
    if not path.is_file():
        raise UsageError(
            f"There is no {RESULTS} in {folder}."
            if folder.is_dir() else f"There is no folder {folder}.",
            cause="no batch has written its results there, or a typing error in the path.",
            fix=f"heli3dof batch identify REC... -o {folder}",
        )  # fmt: skip
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, restkey="")
            rows = [{k: _cell(k, v) for k, v in row.items() if k} for row in reader]
            columns = reader.fieldnames or []
    except (UnicodeDecodeError, csv.Error) as error:
        raise _unusable(path, str(error)) from error
    missing = [c for c in NEEDED if c not in columns]
    if missing:
        raise _unusable(path, f"the column {missing[0]} is missing")
    if not rows:
        raise _unusable(path, "it has no rows")
    return rows


def _unusable(path: Path, why: str) -> RecordingError:
    return RecordingError(
        f"{path} cannot be used: {why}.",
        cause="another program wrote the file, or the batch was interrupted.",
        fix=f"heli3dof batch identify REC... -o {path.parent}",
    )


def _cell(column: str, text: str | None) -> Any:
    if text is None or not text.strip():
        return None
    if column in TEXTS:
        return text
    try:
        return float(text)
    except ValueError:
        return text
