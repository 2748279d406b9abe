"""What ``heli3dof fleet`` prints, and the calibration of its search, in fleet.md."""

from __future__ import annotations

import io
import tempfile
import textwrap
from pathlib import Path

from rich.console import Console

from heli3dof.fleet.analyse import analyse
from heli3dof.fleet.rows import read_rows
from heli3dof.report.text.fleet_sentences import finding_sentences, remark_sentences
from heli3dof.report.text.fleet_tables import rig_table
from heli3dof.report.text.table import to_rich
from tests.fleet.calibration import FLIGHTS, QUANTITIES, SERIES, TERMS, false_alarms, steps_found
from tests.fleet.making import term_rows, write_results
from tests.pages.page import Page, table

WIDTH = 100
FIRST_SEED = 100
"""The tests use the seeds below"""


def output() -> str:
    """Markdown: the sentences and the table of the made term."""
    with tempfile.TemporaryDirectory() as name:
        write_results(Path(name), term_rows())
        fleet = analyse(read_rows(Path(name)))
    text = io.StringIO()
    Console(file=text, width=WIDTH, no_color=True).print(to_rich(rig_table(fleet)))
    sentences = [*finding_sentences(fleet), *remark_sentences(fleet)]
    lines = [
        *(line for s in sentences for line in textwrap.wrap(s, WIDTH, subsequent_indent="  ")),
        "", *(line.rstrip() for line in text.getvalue().splitlines()),
    ]  # fmt: skip
    return "\n".join(["```", "$ heli3dof fleet term", *lines, "```"])


def calibration() -> str:
    """Markdown: false alarms and found steps of simulated flights."""
    rows = [
        (f"no change, {n} flights, {QUANTITIES} quantities a rig", "rig-terms with a report",
         f"{false_alarms(n, 1.0, FIRST_SEED + n)} of {TERMS}")
        for n in (8, 50)
    ] + [
        (f"a step of {size} standard deviations in {FLIGHTS} flights", "found, date ± 1 flight",
         f"{steps_found(size, FIRST_SEED + size)} of {SERIES}")
        for size in (4, 6, 10)
    ]  # fmt: skip
    return table(("simulated", "counted", "result"), rows)


PAGE = Page("docs/explanation/fleet.md", {"output": output, "calibration": calibration})
