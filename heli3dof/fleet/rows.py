"""Read a batch's results table for the analysis of a fleet: one dict per recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from heli3dof.batch import results_table

RESULTS = results_table.CSV
NEEDED = ("recording", "rig", "exit_code")


def read_rows(folder: Path) -> list[dict[str, Any]]:
    """Return the rows of the results table in ``folder``, without those of bootstrap replicates.

    An empty cell is None. Raises UsageError if the table is missing, RecordingError if it cannot be
    used.
    """
    rows = results_table.read_rows(folder, needed=NEEDED)
    return [row for row in rows if not row.get("replicate")]
