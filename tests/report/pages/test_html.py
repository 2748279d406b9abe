from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from heli3dof.comparison.compare import compare
from heli3dof.errors import OutputExists
from heli3dof.model.linear.hover import hover_model
from heli3dof.paper.reproduction import reproduce
from heli3dof.report.figures.diagnosis import evidence_figure
from heli3dof.report.figures.diagnosis_data import FigureData
from heli3dof.report.figures.flight import flight_figure
from heli3dof.report.figures.models import BodeCurve, bode_figure, residual_figure
from heli3dof.report.figures.style import BLUE, SOFT
from heli3dof.report.figures.torque_curve import TorqueCurve
from heli3dof.report.figures.web import decimated, live_data
from heli3dof.report.pages.answers import diagnosis_answers
from heli3dof.report.pages.diagnosis_section import diagnosis_section
from heli3dof.report.pages.flight_report import flight_report
from heli3dof.report.pages.html import bars, facts, write_page
from heli3dof.report.pages.model_section import bode_of, plant_poles, poles_text
from heli3dof.report.text.comparison_sentences import comparison_text
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, flight
from tests.report.text.test_diagnosis_tables import DOCUMENT

NASTY = '<script>alert("1")</script> & co'
VOID = {"meta", "img", "br", "hr", "link", "input"}


class Checker(HTMLParser):
    """Checks that tags are closed in order and that nothing refers to another file."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if "id" in given:
            self.ids.append(str(given["id"]))
        for name in ("src", "href"):
            address = given.get(name) or "#"
            assert address.startswith(("#", "data:image/svg+xml,%3Csvg")), address[:80]
        assert tag not in {"link", "iframe", "object"}

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] not in (["script"], ["style"]):
            self.text.append(data)


def checked(document: str) -> str:
    parser = Checker()
    parser.feed(document)
    assert parser.open == []
    assert len(set(parser.ids)) == len(parser.ids)
    own = re.sub(r'src="data:[^"]*"|<script>.*</script>', "", document, flags=re.DOTALL)
    assert not re.search(r"https?://|@import|url\(", own)
    return " ".join("".join(parser.text).split())


@pytest.fixture(scope="module")
def document() -> str:
    recording = flight(truth=FakeHover(thrust=0.8), noise_deg=0.05, name=NASTY)
    meta = {
        **recording.meta,
        "warnings": [f"the log {NASTY}"],
        "outcome": "tripped",
        "outcome_details": {"detail": "roll above 34°", "periods": 5000},
        "versions": {"numpy": "2.1"},
        "plan": {"name": "step", "segments": [{"kind": "hold", "roll_deg": 0.0}] * 30},
    }
    recording = replace(recording, meta=meta)
    hover = hover_model(default_profile())
    printed = hover_model(default_profile(), printed=True)
    result = compare([recording], [hover, printed])
    return flight_report(
        [recording],
        models=[hover, printed],
        comparison=result,
        reproduced=reproduce(hover),
    )


def test_the_report_is_well_formed_and_refers_to_no_other_file(document: str) -> None:
    checked(document)


def test_text_from_a_recording_is_escaped(document: str) -> None:
    assert "<script>alert" not in document
    assert NASTY in checked(document)


def test_the_report_has_all_its_sections(document: str) -> None:
    text = checked(document)
    for part in (
        "How wrong is the simulation?",
        "Which model predicts best?",
        "What to do next?",
        "Warnings",
        "the flight did not end as planned; tripped: roll above 34°",
        "unstable in this loop, with a pole at +1.469 rad/s",
        "The flight",
        "Models",
        "−1.14 ± 1.86j",
        "Comparison",
        "Table II",
        "The paper's numbers",
        "11.75",
        "Provenance",
        "versions.numpy",
    ):
        assert part in text, part
    assert document.count('<img alt="Figure') == 3


def test_each_section_shows_a_figure_and_a_table_and_folds_the_rest(document: str) -> None:
    comparison = document[document.index("<h2>Comparison") : document.index("<h2>The flight")]
    shown, folded = comparison.split("<details>")
    assert (shown.count("<figure"), shown.count("<table")) == (1, 1)
    assert "<summary>Details: 2 figures, 3 tables</summary>" in folded


def test_a_live_figure_holds_the_samples_of_its_static_picture() -> None:
    recording = flight(duration_s=2.0)
    panel = live_data(flight_figure(recording))["panels"][0]
    reference, measured = panel["curves"]
    assert (panel["x"], panel["y"]) == ("time (s)", "roll r (°)")
    assert (reference["name"], reference["dash"] != []) == ("reference", True)
    assert measured["x"] == pytest.approx(recording.t, rel=1e-5)
    assert measured["y"] == pytest.approx(np.degrees(recording.angle[:, 0]), rel=1e-5, abs=1e-9)


def test_decimation_keeps_ends_peaks_and_gaps() -> None:
    y = np.sin(np.linspace(0, 9, 5000))
    y[1234], y[3000] = 7.0, np.nan
    rows = decimated(y, 200)
    assert len(rows) < 320
    assert {0, 1234, 3000, 4999} <= set(rows.tolist())


def test_bands_error_bars_and_stems_reach_the_live_figure() -> None:
    omega = np.geomspace(0.1, 10, 20)
    curve = BodeCurve("model", "statespace", 1 / (1j * omega + 1), 0.1 * np.ones(20))
    bode = live_data(bode_figure(omega, {"roll": [curve], "yaw": [curve]}, title="t"))
    magnitude = bode["panels"][0]
    assert [(p["title"], p["y"]) for p in bode["panels"]] == [
        ("roll", "magnitude (dB)"), ("yaw", "magnitude (dB)"),
        ("roll", "phase (°)"), ("yaw", "phase (°)"),
    ]  # fmt: skip
    assert magnitude["log"]
    assert len(magnitude["bands"][0]["x"]) >= 40
    noise = np.random.default_rng(1).normal(size=(200, 3))
    panels = live_data(residual_figure(np.arange(200) * 0.01, noise))["panels"]
    assert (panels[0]["y"], panels[1]["y"]) == ("roll r (m°)", "")
    assert panels[1]["curves"][0]["kind"] == "stems"
    assert panels[1]["spans"][0]["ends"] == pytest.approx([-2.58 / 200**0.5, 2.58 / 200**0.5], 1e-4)
    z = np.linspace(-1, 1, 5)
    torque = TorqueCurve("c", "yaw", "yaw_rate", "°/s", z, z, 0.1 + 0 * z, z, z)
    points, line = live_data(evidence_figure(torque))["panels"][0]["curves"]
    assert points["error"] == pytest.approx([0.1] * 5)
    assert line["name"] == "fitted cause"


def test_bars_state_their_numbers_and_leave_out_missing_ones() -> None:
    text = bars({"yaw": {"a": 2.0, "b": np.nan}}, {"a": BLUE, "b": SOFT}, "RMSE", "alt")
    assert "RMSE: " in text
    assert "2.00°" in text
    assert "width:80.0%" in text
    assert text.count("%") == 1


def test_without_a_cause_the_answers_state_the_verdict_and_no_gain() -> None:
    document = {**DOCUMENT, "verdict": "nothing_found", "findings": [], "leftover": []}
    _, cause, gain, _ = diagnosis_answers(document, FigureData(), dt=0.01)
    assert cause.sentence.startswith("Verdict: nothing found.")
    assert gain.sentence.startswith("Nothing:")


def test_the_diagnosis_section_states_an_error_without_an_explanation() -> None:
    rest = {"axis": "pitch", "depends_on": None, "share": 0.0, "term": None, "formula": None}
    error = {"simulation": 7.0, "extended_model": 6.2, "noise_floor": 0.1}
    document = {**DOCUMENT, "leftover": [{**rest, "error_deg": error}], "about": {}}
    section = diagnosis_section({**document, "verdict": "unexplained"})
    assert "pitch 6.20° of 7.00° (noise 0.10°)" in "".join(section.details)


def test_a_diagnosis_answers_the_four_questions_in_order() -> None:
    answers = diagnosis_answers({**DOCUMENT, "about": {}}, FigureData(), dt=0.01)
    assert [a.question.split()[0:2] for a in answers] == [
        ["How", "wrong"], ["What", "is"], ["What", "does"], ["What", "to"],
    ]  # fmt: skip
    assert "friction.coulomb.yaw" in answers[1].sentence
    assert "References of the plan coast-down" in answers[3].picture


def test_the_same_flight_gives_the_same_report() -> None:
    recording = flight(duration_s=2.0)
    assert flight_report([recording]) == flight_report([recording])


def test_a_log_of_one_angle_has_a_report() -> None:
    recording = flight(duration_s=4.0)
    angle = recording.angle.copy()
    angle[:, 1:] = np.nan
    profile = default_profile().model_copy(update={"controller": None})
    log = replace(recording, angle=angle, profile=profile, meta={"name": "log"})
    other = replace(log, meta={"name": "other"})
    text = checked(flight_report([log, other], comparison=compare([log, other], [FakeHover()])))
    assert "2 recordings" in text
    assert "the controller is unknown" in text


def test_facts_omit_missing_values() -> None:
    assert facts({"a": None, "b": 0}) == "<dl><dt>b</dt><dd>0</dd></dl>"


def test_a_report_never_overwrites_another(tmp_path: Path) -> None:
    path = write_page("one", tmp_path / "report.html")
    with pytest.raises(OutputExists):
        write_page("two", path)
    assert path.read_text() == "one"


def test_poles_are_printed_as_pairs_and_repeated_ones_counted() -> None:
    poles = np.array([-1.5 - 0.79j, -0.1, -1.5 + 0.79j, 0.0, 1e-4])
    assert poles_text(poles) == "0 (twice), −0.10, −1.50 ± 0.79j"
    assert poles_text(plant_poles(hover_model(default_profile()))) == "0 (6 times)"


def test_the_hover_model_s_response_is_the_double_integrator_s() -> None:
    """Both motors 1 V up: r/V = 2 L_a K_f / (J_roll s²); at 1 rad/s that is 0.1716 rad/V."""
    omega, channels = bode_of([hover_model(default_profile())])
    k = int(np.argmin(abs(omega - 1.0)))
    g = channels["roll / both motors (rad/V)"][0].response[k]
    assert abs(g) * omega[k] ** 2 == pytest.approx(2 * 0.6604 * 0.1188 / 0.9145, rel=1e-3)


def test_the_first_sentences_give_each_models_errors() -> None:
    recording = flight(truth=FakeHover(thrust=0.8))
    same = FakeHover(name="same", thrust=0.8)
    only = compare([recording], [FakeHover(), same]).flights[0]
    text = comparison_text(only)
    peak = only.difference(only.models[0], "roll")["peak_deg"]
    assert peak < 0
    assert f"hover's roll peaks {-peak:.1f}° lower" in text
    assert (
        "same's roll peaks at the same height; its RMSE over the flight is 0.00°, 0.00°, 0.00°"
        in text
    )
    assert only.constant_angles is not None
    still = only.constant_angles.over_window_deg[0]
    assert "RMSE of roll predictions over 3 s" in text
    assert f"{still:.1f}° (constant angles)." in text
