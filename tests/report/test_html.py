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
from heli3dof.report.flight_report import flight_report, in_a_sentence
from heli3dof.report.html import Section, facts, paragraph, write_page
from heli3dof.report.model_section import discrete_response, plant_poles, poles_text
from heli3dof.rig.profile import default_profile
from tests.comparison.fakes import FakeHover, flight

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
            assert address.startswith(("#", "data:image/svg+xml;base64,")), address
        assert tag not in {"script", "link", "iframe", "object"}

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def checked(document: str) -> str:
    parser = Checker()
    parser.feed(document)
    assert parser.open == []
    assert len(set(parser.ids)) == len(parser.ids)
    assert not re.search(r"https?://|@import|url\(", document)
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
        extra=[Section("Diagnosis", [paragraph("friction in yaw")]), Section("Empty", [])],
        lede=["A sentence from elsewhere."],
    )


def test_the_report_is_well_formed_and_refers_to_no_other_file(document: str) -> None:
    checked(document)


def test_text_from_a_recording_is_escaped(document: str) -> None:
    assert "<script" not in document
    assert NASTY in checked(document)


def test_the_report_has_all_its_sections(document: str) -> None:
    text = checked(document)
    for part in (
        "Summary",
        "A sentence from elsewhere.",
        "Warnings",
        "the flight did not end as planned; tripped: roll above 34°",
        "unstable in this loop, with a pole at +1.469 rad/s",
        "The flight",
        "Models",
        "−1.14 ± 1.86j",
        "Comparison",
        "Table II",
        "Diagnosis",
        "The paper's numbers",
        "11.75",
        "Provenance",
        "versions.numpy",
    ):
        assert part in text, part
    assert "Empty" not in text
    assert document.count('<img alt="Figure') == 3


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
    m = hover_model(default_profile())
    g = discrete_response(m.A, m.B, m.C, m.dt, np.array([1.0]))[0, 0].sum()
    assert abs(g) == pytest.approx(2 * 0.6604 * 0.1188 / 0.9145, rel=1e-3)


def test_the_first_sentences_give_each_models_errors() -> None:
    recording = flight(truth=FakeHover(thrust=0.8))
    same = FakeHover(name="same", thrust=0.8)
    only = compare([recording], [FakeHover(), same]).flights[0]
    text = in_a_sentence(only)
    peak = only.difference(only.models[0], "roll")["peak_deg"]
    assert peak < 0
    assert f"hover peaks {-peak:.1f}° lower" in text
    assert "same peaks at the same height; its RMSE over the flight is 0.00°, 0.00°, 0.00°" in text
    assert only.constant_angles is not None
    still = only.constant_angles.over_window_deg[0]
    assert "RMSE of roll predictions over 3 s" in text
    assert f"{still:.1f}° (constant angles)." in text
