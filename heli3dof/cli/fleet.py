"""``heli3dof fleet``: analyses the recordings of many rigs.

It finds changes of a rig over time, rigs that differ from the others, and unusable recordings.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from heli3dof.cli.options import Force, Verbose
from heli3dof.cli.output import Output, verb

if TYPE_CHECKING:
    from heli3dof.fleet.result import Fleet

MOST_LINES = 12
"""Largest number of sentences; with a table of 20 rigs they fit 40 lines (a convention)"""


def register(app: typer.Typer) -> None:
    app.command("fleet", rich_help_panel="Many recordings")(fleet)


@verb
def fleet(
    out: Output,
    folder: Annotated[
        Path, typer.Argument(metavar="OUT", help="The folder of a batch, with results.csv.")
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE.html", help="Write an HTML page with figures."
        ),
    ] = None,
    force: Force = False,
    verbose: Verbose = False,
) -> None:
    """State what changed on which rig, which rigs differ, and which recordings are not used.

    Example: heli3dof fleet term -o term.html
    """
    from heli3dof.batch import results_table
    from heli3dof.fleet.analyse import analyse
    from heli3dof.fleet.tracks import read_rows
    from heli3dof.recording.atomic_write import check_ending, check_outputs

    if output is not None:
        check_outputs(output, force=force, inputs=[folder / results_table.CSV])
        check_ending(output, ".html")
    rows = read_rows(folder)
    with out.working("Searching for changes …"):
        found = analyse(rows)
    _show(out, found, verbose=verbose)
    if output is not None:
        from heli3dof.report.pages.fleet_page import fleet_page
        from heli3dof.report.pages.html import write_page

        with out.working("Drawing …"):
            text = fleet_page(found, title=f"Fleet: {folder.name}")
        write_page(text, output, force=force)
        out.note(f"Page: {output}")
    out.emit(found.to_dict())


def _show(out: Output, found: Fleet, *, verbose: bool) -> None:
    """Print the findings and a table of the rigs.

    ``verbose``: True prints also a table of each quantity and a table of the unused recordings.
    """
    from heli3dof.report.text.fleet_sentences import finding_sentences, remark_sentences
    from heli3dof.report.text.fleet_tables import bad_table, quantity_table, rig_table

    sentences = finding_sentences(found)
    shown = sentences if verbose else sentences[:MOST_LINES]
    out.show(*shown)
    if len(shown) < len(sentences):
        out.show(f"{len(sentences) - len(shown)} more findings: add --verbose")
    out.show(*remark_sentences(found))
    out.show("", rig_table(found))
    if verbose:
        grids = [*map(quantity_table, found.quantities), *([bad_table(found)] if found.bad else [])]
        for grid in grids:
            out.show("", grid)
    else:
        out.note("For all quantities and the recordings not used add --verbose")
