"""Figures of a fleet: one panel a rig, the changes marked."""

from __future__ import annotations

import pytest

from heli3dof.fleet.analyse import analyse
from heli3dof.report.figures.fleet import fleet_figure
from heli3dof.report.figures.web import live_data
from tests.fleet.making import DEVIATING, DRIFT, STEP, term_rows


@pytest.fixture(scope="module")
def fleet():  # type: ignore[no-untyped-def]
    return analyse(term_rows())


def test_one_panel_for_each_rig_with_its_flights(fleet) -> None:  # type: ignore[no-untyped-def]
    panels = live_data(fleet_figure(fleet))["panels"]
    assert [p["title"] for p in panels] == ["rig-01", "rig-02", "rig-03", "rig-04", "rig-05"]
    assert [len(p["curves"][0]["x"]) for p in panels] == [24, 24, 22, 24, 24]


def test_a_step_is_a_band_between_its_two_flights(fleet) -> None:  # type: ignore[no-untyped-def]
    """Flights 13 and 14 are on Wednesday of week 7 and Monday of week 8: days 44 and 49."""
    panel = live_data(fleet_figure(fleet, STEP[1]))["panels"][1]
    (ends,) = [s["ends"] for s in panel["spans"] if s["axis"] == "x"]
    assert ends == pytest.approx([44, 49], abs=0.02)


@pytest.mark.parametrize(("change", "name"), [(DRIFT, "drift"), (DEVIATING, "deviating")])
def test_drifts_and_deviating_flights_are_marked(fleet, change, name) -> None:  # type: ignore[no-untyped-def]
    panels = live_data(fleet_figure(fleet, change[1]))["panels"]
    marked = [p["title"] for p in panels if name in [c["name"] for c in p["curves"]]]
    assert marked == [change[0]]


def test_flights_of_another_plan_are_hollow() -> None:
    rows = [{**r, "plan": "steps" if r["name"].endswith("-05") else "rich"} for r in term_rows()]
    figure = fleet_figure(analyse(rows), STEP[1])
    points = [c.lines[0] for c in figure.axes[0].containers]
    assert [len(p.get_xdata()) for p in points] == [23, 1]
    assert points[1].get_markerfacecolor() == "white"
