"""The page of a fleet, with a rig whose name needs escaping."""

from __future__ import annotations

from heli3dof.fleet.analyse import analyse
from heli3dof.report.pages.fleet_page import MOST_FIGURES, drawn_quantities, fleet_page
from tests.fleet.making import DEVIATING, DIFFERS, DRIFT, STEP, term_rows
from tests.report.pages.test_html import NASTY, checked


def test_the_page_is_well_formed_and_has_a_figure_for_each_quantity() -> None:
    rows = term_rows()
    for row in rows:
        row["rig"] = row["rig"].replace("rig-02", NASTY)
    fleet = analyse([r for r in rows if r["rig"] in ("rig-01", NASTY)])
    document = fleet_page(fleet)
    text = checked(document)
    assert "What changed?" in text
    assert f"{NASTY}: thrust_gain_ratio changed by −0.06" in text
    assert document.count("<img") == len(fleet.quantities) + 1


def test_quantities_with_findings_and_the_main_ones_are_drawn_first() -> None:
    same = {f"a{i}{end}": 1.0 for i in range(20) for end in ("", "_std")}
    rows = [same | row for row in term_rows()]
    names = [q.name for q in drawn_quantities(analyse(rows))]
    assert names[:4] == [STEP[1], DRIFT[1], DEVIATING[1], DIFFERS[1]]
    assert set(names[4:7]) == {"hover_voltage_V", "jitter_s", "lost_share"}
    assert len(names) == MOST_FIGURES


def test_a_fleet_without_findings_says_so() -> None:
    fleet = analyse([r for r in term_rows() if r["rig"] == "rig-03" and r["exit_code"] == 0])
    text = checked(fleet_page(fleet))
    assert "No quantity of 1 rig changed." in text
    assert "None: the rigs differ no more than by chance." in text
