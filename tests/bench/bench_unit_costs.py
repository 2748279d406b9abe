"""Measures the unit costs of `heli3dof batch`: CPU time, bytes and memory of one recording.

CPU times depend little on other work on the computer. `docs/explanation/scale.md` is computed from
the table of this topic.
"""

from __future__ import annotations

import sys
import tempfile
import tracemalloc
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from heli3dof.batch.engines.processes import Processes
from heli3dof.batch.output_folder import JOURNAL, journal_lines
from heli3dof.batch.results_table import CSV, write_table
from tests.bench import Figure, Table
from tests.bench.bench_batch import QUICK, batch, flown

TITLE = "Costs of one recording"
INTRO = """Medians over some recordings of `bench_batch`, without the start of the processes."""
VERBS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "info": ("info", {}),
    "identify": ("identify", {}),
    "diagnose --quick": ("diagnose", QUICK),
    "diagnose": ("diagnose", {**QUICK, "quick": False}),
}
RECORDINGS = 6
"""Recordings per verb; their costs differ by less than a factor of two"""
COPIES = 200
"""Copies of each row when the memory is measured. Chosen: 1,200 rows need some MB."""
HEAD = (
    "verb", "CPU s", "MB in", "MB out", "CPU s of `batch` itself", "kB of documents and models",
    "kB of journal", "kB of results.csv", "kB of memory",
)  # fmt: skip
MB, KB = 1e6, 1e3


def measure() -> list[Table | Figure]:
    rows = costs(flown(RECORDINGS))
    figures = [
        Figure(
            f"`batch {row[0]}`: CPU time per recording", f"{row[1]} s",
            how=f"median of {RECORDINGS} flights of about a minute at 500 Hz, {row[2]} MB each",
        )
        for row in rows
    ]  # fmt: skip
    return [*figures, Table("Cost of one recording, about a minute at 500 Hz", HEAD, tuple(rows))]


def costs(paths: Sequence[str]) -> list[tuple[str, ...]]:
    """Rows of costs per recording, one row a verb: medians over the recordings, from the journal.

    The median leaves out the first recording of each process, which also compiles. Memory: what
    `batch` itself needs at its end, when it writes the table.
    """
    rows = []
    for name, (verb, options) in VERBS.items():
        with batch(verb, options, paths, Processes()) as (folder, arrivals):
            lines = list(journal_lines(folder))
            kept = sum(p.stat().st_size for p in folder.rglob("*") if p.parent != folder)
            journal = (folder / JOURNAL).stat().st_size
            memory, table = memory_and_table(folder)
        cost = {k: float(np.median([x["cost"][k] for x in lines])) for k in lines[0]["cost"]}
        rows.append((
            name, f"{cost['cpu_s']:.2f}", f"{cost['read_bytes'] / MB:.2f}",
            f"{cost['sent_bytes'] / MB:.3f}", f"{arrivals.own_s:.4f}",
            *(f"{x / len(lines) / KB:.1f}" for x in (kept, journal, table, memory)),
        ))  # fmt: skip
        print(f"  {rows[-1]}", file=sys.stderr)
    return rows


def memory_and_table(folder: Path) -> tuple[float, float]:
    """(bytes of memory to write the table, bytes of results.csv), for the folder's recordings.

    Measured with `COPIES` of each row, so that what does not grow with the rows does not count.
    """
    with tempfile.TemporaryDirectory() as name:
        copies = Path(name)
        (copies / JOURNAL).write_bytes((folder / JOURNAL).read_bytes() * COPIES)
        tracemalloc.start()
        write_table([line["row"] for line in journal_lines(copies)], copies)
        _, memory = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return memory / COPIES, (copies / CSV).stat().st_size / COPIES
