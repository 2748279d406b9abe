"""What ``heli3dof fleet`` prints, in fleet.md, and what it finds, in results/fleet.md."""

from __future__ import annotations

import io
import tempfile
import textwrap
from pathlib import Path

from rich.console import Console

from heli3dof.fleet.analyse import analyse
from heli3dof.fleet.result import Fleet
from heli3dof.fleet.tracks import read_rows
from heli3dof.report.text.fleet_sentences import finding_sentences, remark_sentences
from heli3dof.report.text.fleet_tables import rig_table
from tests.fleet.calibration import (
    FLIGHTS,
    QUANTITIES,
    RIGS,
    SERIES,
    TERMS,
    false_alarms,
    false_alarms_correlated,
    false_alarms_in_rooms,
    steps_found,
)
from tests.fleet.making import term_rows, write_results
from tests.pages.page import Page, table
from tests.paths import ROOT

REAL = ROOT / "docs" / "results" / "data" / "real-fleet.txt"
WIDTH = 100
FIRST_SEED = 100
"""See `tests.fleet.calibration`"""
FEW = (8, 12, 20)
"""Numbers of flights of the table of power"""
SIZES = (4, 6, 8)
"""Steps of that table, in standard deviations of a flight"""
ODD = 4.0
CORRELATION = 0.6


def output() -> str:
    """Markdown: the sentences and the table of the made term."""
    with tempfile.TemporaryDirectory() as name:
        write_results(Path(name), term_rows())
        return printed("term", analyse(read_rows(Path(name))))


def real() -> str:
    """Markdown: the same of the public logs, as `bench_real_fleet` has stored it."""
    return REAL.read_text(encoding="utf-8").rstrip()


def printed(folder: str, fleet: Fleet) -> str:
    """Markdown: what ``heli3dof fleet FOLDER`` prints."""
    text = io.StringIO()
    Console(file=text, width=WIDTH, no_color=True).print(rig_table(fleet))
    sentences = [*finding_sentences(fleet), *remark_sentences(fleet)]
    lines = [
        *(line for s in sentences for line in textwrap.wrap(s, WIDTH, subsequent_indent="  ")),
        "", *(line.rstrip() for line in text.getvalue().splitlines()),
    ]  # fmt: skip
    return "\n".join(["```", f"$ heli3dof fleet {folder}", *lines, "```"])


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
    ] + [
        (f"no change, 8 flights, {RIGS} rigs of one kind", "rig-terms with a report",
         f"{false_alarms_in_rooms(8, 0.0, 1.0, FIRST_SEED + 1)} of {TERMS}"),
        (f"the same, one rig scatters {ODD:g} times as much", "rig-terms with a report",
         f"{false_alarms_in_rooms(8, 0.0, ODD, FIRST_SEED + 2)} of {TERMS}"),
        (f"no change, {FLIGHTS} flights, correlation {CORRELATION:g} from flight to flight",
         "series with a report",
         f"{false_alarms_correlated(FLIGHTS, CORRELATION, FIRST_SEED + 3)} of {SERIES}"),
    ]  # fmt: skip
    return table(("simulated", "counted", "result"), rows)


def power() -> str:
    """Markdown: found steps in few flights, of one rig alone and with its siblings."""
    rows = [
        (str(n), f"{size}", *(
            f"{steps_found(size, FIRST_SEED + n + size, flights=n, siblings=s)} of {SERIES}"
            for s in (0, RIGS - 1)
        ))
        for n in FEW for size in SIZES
    ]  # fmt: skip
    return table(("flights", "step, in standard deviations", "one rig", f"{RIGS} rigs"), rows)


PAGE = Page("docs/explanation/fleet.md", {"output": output}, slow=True)
RESULTS_PAGE = Page(
    "docs/results/fleet.md", {"real": real, "calibration": calibration, "power": power}, slow=True
)
