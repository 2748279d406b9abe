"""Measures the unit costs of `heli3dof batch`: CPU time, bytes and memory of one recording.

CPU times depend little on other work on the computer. `docs/explanation/scale.md` is computed from
the table of this topic.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from collections.abc import Mapping, Sequence
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
        before = time.process_time()
        with batch(verb, options, paths, Processes()) as (folder, _):
            own_s = (time.process_time() - before) / len(paths)
            tracemalloc.start()
            lines = journal_lines(folder)
            write_table([line["row"] for line in lines], folder)
            _, memory = tracemalloc.get_traced_memory()
            tracemalloc.stop()
            table = len((folder / CSV).read_bytes().partition(b"\n")[2])
            kept = sum(p.stat().st_size for p in folder.rglob("*") if p.parent != folder)
            journal = (folder / JOURNAL).stat().st_size
        cost = {k: float(np.median([x["cost"][k] for x in lines])) for k in lines[0]["cost"]}
        rows.append((
            name, f"{cost['cpu_s']:.2f}", f"{cost['read_bytes'] / MB:.2f}",
            f"{cost['sent_bytes'] / MB:.3f}", f"{own_s:.3f}",
            *(f"{x / len(lines) / KB:.1f}" for x in (kept, journal, table, memory)),
        ))  # fmt: skip
        print(f"  {rows[-1]}", file=sys.stderr)
    return rows
