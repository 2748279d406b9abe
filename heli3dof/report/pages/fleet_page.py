"""Write the HTML page of a fleet: what changed and which rigs differ, then each quantity."""

from __future__ import annotations

from heli3dof.fleet.result import Fleet, FleetQuantity
from heli3dof.report.figures.fleet import figure_alt, quantity_figure
from heli3dof.report.pages.html import Answer, Section, figure, page, paragraph, table
from heli3dof.report.text.fleet_sentences import (
    REPORT_LIMIT,
    change_sentence,
    change_sentences,
    difference_sentence,
    remark_sentences,
)
from heli3dof.report.text.fleet_tables import bad_table, main_quantities, quantity_table, rig_table

MOST_FIGURES = 12
"""Largest number of figures; it bounds the page to 1 MB for 3000 flights (a convention)"""


def fleet_page(fleet: Fleet, *, title: str = "Fleet") -> str:
    """Return the HTML page of a fleet."""
    drawn = drawn_quantities(fleet)
    others = [q for q in fleet.quantities if q not in drawn]
    sections = [Section("Rigs", [table(rig_table(fleet))])]
    sections += [_section(fleet, q) for q in drawn]
    sections.append(Section("Other quantities", (), [table(quantity_table(q)) for q in others]))
    if fleet.bad:
        sections.append(Section("Recordings not used", [table(bad_table(fleet))]))
    subtitle = f"{len(fleet.rigs)} rigs, {fleet.recordings} recordings"
    return page(title, subtitle, sections, answers=_answers(fleet), footer=REPORT_LIMIT)


def drawn_quantities(fleet: Fleet) -> list[FleetQuantity]:
    """Return the quantities for which the page contains a figure, at most `MOST_FIGURES`.

    Quantities that changed or that differ between rigs come first. Then follow the quantities in
    the table of rigs (`main_quantities`), and then all others.
    """
    stated = [track.quantity for track, _ in fleet.changes()]
    stated += [quantity for quantity, _ in fleet.differences()]
    first = [q for name in dict.fromkeys(stated) for q in fleet.quantities if q.name == name]
    main = [q for q, _ in main_quantities(fleet)]
    return list(dict.fromkeys([*first, *main, *fleet.quantities]))[:MOST_FIGURES]


def _answers(fleet: Fleet) -> list[Answer]:
    different = [difference_sentence(quantity, d) for quantity, d in fleet.differences()]
    rest = list(remark_sentences(fleet))
    drawn = ""
    if fleet.changes():
        first = fleet.changes()[0][0].quantity
        q = next(q for q in fleet.quantities if q.name == first)
        drawn = figure(quantity_figure(q), figure_alt(q))
    answers = [
        Answer("What changed?", " ".join(change_sentences(fleet)), drawn),
        Answer(
            "Which rigs differ from the others?",
            " ".join(different) or "None: the rigs differ no more than by chance.",
        ),
    ]
    if rest:
        answers.append(Answer("What limits these results?", " ".join(rest)))
    return answers


def _section(fleet: Fleet, q: FleetQuantity) -> Section:
    stated = [change_sentence(t, c) for t, c in fleet.changes() if t.quantity == q.name]
    stated += [difference_sentence(n, d) for n, d in fleet.differences() if n == q.name]
    blocks = [*map(paragraph, stated), figure(quantity_figure(q), figure_alt(q))]
    return Section(q.name, blocks, [table(quantity_table(q))])
