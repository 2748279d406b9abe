"""The summary of a diagnosis fits a screen and has the important line first."""

from __future__ import annotations

import json
from copy import deepcopy
from typing import Any

import pytest

from heli3dof.axes import AXES
from heli3dof.model.effects import Effect, Parameter
from heli3dof.report.text import diagnosis_sentences
from heli3dof.report.text.diagnosis_summary import diagnosis_summary
from heli3dof.report.text.diagnosis_tables import findings
from tests.golden.commands import KEPT

MOST_LINES = 10
DOCUMENTS = ("diagnose.json", "diagnose-linear.json")


def kept(name: str) -> dict[str, Any]:
    document: dict[str, Any] = json.loads((KEPT / name).read_text(encoding="utf-8"))["document"]
    return document


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_summary_has_at_most_ten_lines_and_begins_with_the_verdict(name: str) -> None:
    lines = diagnosis_summary(kept(name))
    assert len(lines) <= MOST_LINES
    assert lines[0].startswith("Verdict: ")
    assert lines[1].startswith("Simulation error, RMSE of 1 s predictions: roll ")


@pytest.mark.parametrize("name", DOCUMENTS)
def test_each_cause_is_named_with_what_it_is_confounded_with(name: str) -> None:
    document = kept(name)
    text = "\n".join(diagnosis_summary(document))
    for n, finding in enumerate(document["findings"], start=1):
        axis = f".{finding['axis']}" if finding["axis"] else ""
        assert f"Cause {n}: {finding['effect']}{axis}, " in text
        assert all(other in text for other in finding["tied_with"])


def test_a_noise_floor_above_the_error_is_not_given_as_a_number() -> None:
    document = deepcopy(kept("diagnose.json"))
    document["simulation_error"]["roll"] |= {"rmse_deg": 0.20, "noise_floor_deg": 0.21}
    document["simulation_error"]["yaw"] |= {"rmse_deg": 1.38, "noise_floor_deg": 0.15}
    error = diagnosis_summary(document)[1]
    assert "roll 0.20° (noise)" in error
    assert "yaw 1.38° (noise 0.15°)" in error


def test_the_confidence_of_confounded_causes_is_that_of_one_of_them() -> None:
    document = deepcopy(kept("diagnose.json"))
    document["findings"][0] |= {"tied_with": ["motor.lag"], "confidence": 0.999, "like": False}
    (line,) = [x for x in diagnosis_summary(document) if x.startswith("Cause 1: ")]
    assert line.endswith(
        "or motor.lag, indistinguishable here (one of them acts: confidence > 99 %)."
    )


def test_a_flight_that_a_safety_trip_ended_is_named_before_what_to_fly_next() -> None:
    document = deepcopy(kept("diagnose.json"))
    trip = {
        "check": "flight.tripped", "kind": "note", "recording": "a", "confidence": 0.5,
        "sentence": "a: the flight was ended for safety after 20 s.",
        "cause": "the encoder is frozen.", "fix": "heli3dof monitor",
    }  # fmt: skip
    document["integrity"] = [trip, {**trip, "check": "motion.small", "sentence": "another note"}]
    _verdict, note, *others = diagnosis_summary(document)
    assert note.startswith("Note: Recording a: the flight was ended for safety after 20 s.")
    assert "another note" not in "".join(others)


def test_more_than_four_causes_refer_to_the_tables() -> None:
    document = deepcopy(kept("diagnose.json"))
    first = document["findings"][0]
    document["findings"] = [{**first, "effect": f"cause{n}"} for n in range(6)]
    assert "2 weaker causes: see --verbose." in diagnosis_summary(document)
    del document["findings"][-1]
    assert "1 weaker cause: see --verbose." in diagnosis_summary(document)


def test_wrong_numbers_in_the_profile_are_to_be_updated_first() -> None:
    document = {**deepcopy(kept("diagnose.json")), "verdict": "off_calibration", "findings": []}
    document["model"] = "m.json"
    assert "heli3dof profile update --from m.json" in diagnosis_summary(document)[-1]


@pytest.mark.parametrize(
    ("factors", "stated"),
    [((0.25, 0.26, 0.24), "multiplied by 2.00"), ((0.25, 0.25, 1.0), ""), ((0.9, 0.9, 0.9), "")],
)
def test_a_common_factor_of_all_inertias_may_be_the_time(
    factors: tuple[float, ...], stated: str
) -> None:
    document = {**deepcopy(kept("diagnose.json")), "verdict": "off_calibration", "findings": []}
    document["ratios"] = [
        {"ratio": f"K_f/J_{axis}", "nominal": 0.5, "value": 0.5 * f, "std": 0.001}
        for axis, f in zip(AXES, factors, strict=True)
    ]
    text = "\n".join(diagnosis_summary(document))
    assert ("All ratios K_f/J differ" in text) == bool(stated)
    assert stated in text


def test_what_several_recordings_have_is_stated_once() -> None:
    document = deepcopy(kept("diagnose.json"))
    first = {**document["findings"][0], "effect": "timing.jitter", "axis": None}
    document["findings"] = [first, first, document["findings"][0]]
    fault = {"kind": "finding", "effect": "timing.jitter", "axis": None, "sentence": "a: jitter",
             "cause": "late", "fix": "hurry", "recording": "a"}  # fmt: skip
    document["integrity"] = [fault, *({**fault, "recording": name} for name in "bc")]
    lines = diagnosis_summary(document)
    assert "Recording a: jitter Likely cause: late Try: hurry. The same in b and c" in lines
    stated = [x.split(",")[0] for x in lines if x.startswith("Cause ")]
    assert len(stated) == 2
    assert "Cause 1: timing.jitter" in stated


def test_a_counted_share_is_no_cause_and_has_no_standard_deviation() -> None:
    document = deepcopy(kept("diagnose.json"))
    lost = {"lost_share": {"value": 0.03977, "std": 0.017}}
    document["findings"][0] |= {"effect": "timing.gaps", "axis": None, "parameters": lost}
    lines = diagnosis_summary(document)
    assert "In the recording: timing.gaps, lost share 0.03977 (counted)." in lines
    document["verdict"], document["findings"] = "explained", document["findings"][:1]
    assert "Only lost samples were found" in diagnosis_summary(document)[0]


def test_a_unit_that_the_parameters_name_lacks_is_that_of_the_effect(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    c = Parameter("coefficient", "N·m/(rad/s)", 0.0, -1.0, 1.0, 0.1, "c")
    ours = Effect("torque.ours", "a torque", (c,), {}, AXES)
    monkeypatch.setattr(diagnosis_sentences, "effects", lambda: {ours.name: ours})
    document = deepcopy(kept("diagnose.json"))
    sizes = {"coefficient": {"value": 0.507, "std": 0.018}}
    document["findings"][0] |= {"effect": ours.name, "axis": "yaw", "parameters": sizes}
    text = "\n".join(diagnosis_summary(document))
    assert "torque.ours.yaw, coefficient 0.507 ± 0.018 N·m/(rad/s)" in text
    assert "N·m/(rad/s)" in [row[4] for row in findings(document).rows]
    document["findings"][0]["effect"] = "no.such"  # of a package that is not installed
    assert "no.such.yaw, coefficient 0.507 ± 0.018" in "\n".join(diagnosis_summary(document))


def test_a_cause_without_parameters_has_no_size() -> None:
    document = deepcopy(kept("diagnose.json"))
    document["findings"][0] |= {"effect": "no.such", "axis": None, "parameters": {}}
    assert not [line for line in diagnosis_summary(document) if "no.such," in line]


def test_jitter_of_exact_time_stamps_is_no_cause() -> None:
    document = deepcopy(kept("diagnose.json"))
    jitter = {"jitter_s": {"value": 0.001002, "std": 5.8e-06}}
    jittery = {"effect": "timing.jitter", "axis": None, "parameters": jitter, "allowed_for": True}
    document["findings"][0] |= jittery
    stated = "In the recording: timing.jitter, jitter 0.0010020 ± 0.0000058 s (known from the time "
    assert any(line.startswith(stated) for line in diagnosis_summary(document))
    document["verdict"], document["findings"] = "explained", document["findings"][:1]
    assert "Only uneven time stamps were found" in diagnosis_summary(document)[0]


def test_a_noise_floor_that_the_extended_model_refutes_is_not_called_noise() -> None:
    """Predictions with the causes contain all of the noise: 0.71°. The fitted noise gives 2.79°."""
    document = deepcopy(kept("diagnose.json"))
    document["simulation_error"]["roll"] |= {"rmse_deg": 2.52, "noise_floor_deg": 2.79}
    document["gain"]["holdout_rmse_deg"]["after"]["roll"] = 0.71
    line = next(x for x in diagnosis_summary(document) if x.startswith("Simulation error"))
    assert "roll 2.52° (noise at most 0.71°)" in line


def test_terms_that_are_no_causes_are_left_to_the_tables() -> None:
    document = deepcopy(kept("diagnose.json"))
    parameters = {"torque_Nm": {"value": 0.1, "std": 0.1, "unit": "N·m", "prior_mean": 0.0,
                                "prior_std": 0.1}}  # fmt: skip
    term = {"term": "bias.torque.pitch", "parameters": parameters, "why": "within the prior"}
    document["about"]["kept_within_what_is_known"] = [term] * 16
    assert diagnosis_summary(document) == diagnosis_summary(kept("diagnose.json"))


@pytest.mark.parametrize(
    ("alternatives", "shown"),
    [([], "c × pitch rate, c ="), (["roll*pitch"], "c × pitch rate (as good: roll × pitch), c =")],
)
def test_a_formula_is_shown_with_and_without_alternatives(
    alternatives: list[str], shown: str
) -> None:
    document = deepcopy(kept("diagnose.json"))
    document["leftover"] = [
        {
            "axis": "yaw", "depends_on": "pitch_rate", "share": 0.5, "term": "empirical.yaw.1",
            "formula": "c * pitch_rate", "formula_alternatives": alternatives,
            "formula_parameters": {"c": {"value": 0.1, "std": 0.01, "unit": "N·m·s/rad"}},
            "gain": document["gain"],
        }
    ]  # fmt: skip
    assert shown in "\n".join(diagnosis_summary(document))


def test_a_recording_without_information_is_reported_with_cause_and_remedy() -> None:
    document = {**deepcopy(kept("diagnose.json")), "verdict": "not_identifiable", "findings": []}
    document["integrity"] = [
        {"kind": "not_identifiable", "check": "nothing.moves", "sentence": "a contains no angle.",
         "cause": "no encoder was logged.", "fix": "log roll_deg", "recording": "a"},
    ]  # fmt: skip
    sentence = "a contains no angle. Likely cause: no encoder was logged. Try: log roll_deg"
    assert diagnosis_summary(document)[1] == sentence
