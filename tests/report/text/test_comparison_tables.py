from __future__ import annotations

import io
from dataclasses import replace

import pytest
from rich.console import Console

from heli3dof.comparison.compare import FlightComparison, compare
from heli3dof.comparison.metrics import NOTHING, AxisMetrics, StepMetrics, flight_metrics
from heli3dof.paper.reproduction import reproduce
from heli3dof.report.text.comparison_tables import (
    comparison_grids,
    comparison_summary,
    fit_table,
    metrics_of,
    metrics_table,
    prediction_table,
    published_table,
    step_name,
    table_ii,
)
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, WrongRate, flight
from tests.pages.markdown_table import to_markdown

IDENTIFIED = FakeHover(name="pbsid", kind="statespace", thrust=0.85)


@pytest.fixture(scope="module")
def compared() -> FlightComparison:
    recording = flight(truth=FakeHover(thrust=0.8), noise_deg=0.02)
    return compare([recording], [FakeHover(), IDENTIFIED]).flights[0]


def cell(grid, row_start: list[str], column: str) -> str:  # type: ignore[no-untyped-def]
    (row,) = [r for r in grid.rows if list(r[: len(row_start)]) == row_start]
    return str(row[list(grid.columns).index(column)])


def test_the_metrics_table_has_peak_and_overshoot(compared: FlightComparison) -> None:
    grid = metrics_table(compared)
    step = compared.models[0].metrics["roll"].reported  # type: ignore[index]
    assert cell(grid, ["roll", "hover"], "peak °") == f"{step.peak_deg:.2f}"
    assert cell(grid, ["roll", "hover"], "overshoot °") == f"{step.overshoot_deg:.2f}"
    assert cell(grid, ["pitch", "hover"], "rise s") == "–"
    assert cell(grid, ["pitch", "hover"], "peak °") != "–"
    assert {r[3] for r in grid.rows if r[0] == "pitch"} == {"–"}  # held: no overshoot


def test_a_difference_follows_its_model_with_its_sign(compared: FlightComparison) -> None:
    rows = [list(r) for r in metrics_table(compared).rows]
    k = next(i for i, r in enumerate(rows) if r[:2] == ["roll", "hover"])
    peak = compared.difference(compared.models[0], "roll")["peak_deg"]
    assert rows[k + 1][1].strip() == "Δ"
    assert rows[k + 1][2] == f"{peak:+.2f}".replace("-", "−")


def test_the_table_of_steps_explains_the_error_and_a_missing_settling_time() -> None:
    unset = AxisMetrics(NOTHING, (NOTHING,))
    for seconds, settles in ((20.0, True), (2.0, False)):
        roll = flight_metrics(flight(duration_s=seconds))["roll"]
        grid = metrics_of({"roll": roll, "pitch": unset, "yaw": unset}, "Steps")
        assert (grid.rows[0][-1] != "–") == settles
        assert "angle minus set value, mean over the last tenth" in grid.notes[0]
        assert ["– under settling" in n for n in grid.notes[1:]] == [True] * (not settles)


def test_a_held_axis_has_a_peak_and_no_overshoot() -> None:
    """Pitch tilts during a yaw step: that is a motion, not an overshoot."""
    held = StepMetrics("hold", 0.0, 9.0, 0.0, 0.0, peak_deg=23.4, overshoot_deg=23.4)
    grid = metrics_of({"pitch": AxisMetrics(held, (held,))}, "Steps")
    assert cell(grid, ["pitch", "held at 0° from 0 s"], "peak °") == "23.40"
    assert cell(grid, ["pitch", "held at 0° from 0 s"], "overshoot °") == "–"


def test_table_ii_has_the_published_differences(compared: FlightComparison) -> None:
    grid = table_ii(compared)
    assert grid is not None
    printed = {r[0]: (r[3], r[5]) for r in grid.rows if r[1] == "hover"}
    assert printed == {"roll": ("11", "0"), "pitch": ("13", "2"), "yaw": ("23", "7")}
    printed = {r[0]: (r[3], r[5]) for r in grid.rows if r[1] == "pbsid"}
    assert printed == {"roll": ("1", "1"), "pitch": ("8", "1"), "yaw": ("3", "0")}
    assert "Cannot be reproduced" in grid.notes[0]


def test_the_published_table_gives_a_reason_for_every_number() -> None:
    grid = published_table(reproduce(FakeHover()))
    assert len(grid.rows) == 25
    verdicts = [row[5] for row in grid.rows]
    assert sum(v.startswith("yes") for v in verdicts) == 6
    for verdict in verdicts:
        mark = verdict.split()[1]
        assert any(note.startswith(mark) for note in grid.notes)
    for row in grid.rows:
        assert (row[4] == "–") == row[5].startswith("no")


def test_an_unknown_controller_has_no_table_ii_and_its_predictions_give_the_reason() -> None:
    profile = default_profile().model_copy(update={"controller": None})
    log = replace(flight(duration_s=8.0), profile=profile)
    only = compare([log], [FakeHover(), WrongRate()]).flights[0]
    assert table_ii(only) is None
    assert len(fit_table(compare([log], [FakeHover()])).columns) == 4  # no replay
    grid = prediction_table(only)
    assert grid is not None
    assert any("controller is unknown" in n for n in grid.notes)
    assert any("200 Hz" in n for n in grid.notes)
    assert cell(grid, ["roll", "wrong-rate"], "1 s ahead") == "–"


def test_every_table_renders_in_markdown(compared: FlightComparison) -> None:
    result = compare([compared.recording], [FakeHover()])
    grids = comparison_grids(result, paper=True)
    assert len(grids) == 4
    for grid in grids:
        lines = to_markdown(grid).splitlines()
        body = [line for line in lines if line.startswith("|")]
        assert len(body) == len(grid.rows) + 2


def test_one_table_has_every_recording_and_model(compared: FlightComparison) -> None:
    result = compare([compared.recording] * 2, [FakeHover(), IDENTIFIED])
    grid = fit_table(result)
    assert [r[1] for r in grid.rows] == ["hover", "pbsid", "constant angles"] * 2
    first = result.flights[0].models[0]
    assert first.prediction is not None
    assert grid.rows[0][2] == f"{first.prediction.ahead_deg[1.0][0]:.2f}"
    assert first.replay_rmse_deg is not None
    assert grid.rows[0][5] == f"{first.replay_rmse_deg[0]:.2f}"


def test_many_recordings_share_one_row_by_model(compared: FlightComparison) -> None:
    result = compare([compared.recording], [FakeHover(), IDENTIFIED])
    many = replace(result, flights=result.flights * 5)
    assert "all recordings" in fit_table(many).title
    assert fit_table(many).rows == fit_table(result).rows


def test_the_summary_begins_with_the_verdict_and_has_table_ii_on_request_only(
    compared: FlightComparison,
) -> None:
    result = compare([compared.recording], [FakeHover(), IDENTIFIED])
    first, *rest = comparison_summary(result)
    assert isinstance(first, str)
    assert first.startswith("RMSE of predictions 1 s ahead: ")
    titles = [g.title for g in rest if not isinstance(g, str)]
    assert not any("Table II" in t for t in titles)
    paper = comparison_summary(result, paper=True)
    assert any("Table II" in g.title for g in paper if not isinstance(g, str))


def test_the_widest_table_fits_a_terminal_of_80_columns(compared: FlightComparison) -> None:
    out = io.StringIO()
    Console(file=out, width=80, no_color=True).print(metrics_table(compared))
    text = out.getvalue()
    assert "experiment" in text
    assert "…" not in text
    peak = compared.experiment["roll"].reported.peak_deg
    assert f"{peak:.2f}" in text


def test_a_step_is_named_by_its_values_and_time(compared: FlightComparison) -> None:
    assert step_name(compared.experiment["roll"].reported) == "0 → 10° at 0 s"
    assert step_name(compared.experiment["yaw"].reported) == "held at 0° from 0 s"


def test_a_recording_without_metrics_has_an_empty_table() -> None:
    """`heli3dof info` computes none if the time does not increase."""
    assert metrics_of({}, "Steps").rows == []
