"""The tables and sentences of a diagnosis, written from its document."""

from __future__ import annotations

import copy
import doctest
import re
from typing import Any

import pytest

from heli3dof.report.text import diagnosis_sentences, diagnosis_summary
from heli3dof.report.text import diagnosis_tables as diagnosis_tables_module
from heli3dof.report.text.diagnosis_sentences import (
    VERDICTS,
    causes,
    slow_noise,
    unmodelled_effects,
)
from heli3dof.report.text.diagnosis_tables import diagnosis_tables
from heli3dof.report.text.table import Grid
from tests.pages.markdown_table import to_markdown
from tests.paths import ROOT

ROLL_PITCH_YAW = ("roll", "pitch", "yaw")
DOCUMENT: dict[str, Any] = {
    "schema": "heli3dof.diagnosis/1",
    "recordings": ["step"],
    "holdout": [],
    "verdict": "ambiguous",
    "simulation_error": {
        a: {"rmse_deg": 2.0, "noise_floor_deg": 0.25, "horizon_s": 1.0} for a in ROLL_PITCH_YAW
    },
    "calibration": [
        {"parameter": "T_g", "nominal": 1.0, "value": 1.1, "std": 0.004, "unit": "N·m"}
    ],
    "findings": [
        {
            "effect": "friction.coulomb",
            "axis": "yaw",
            "parameters": {"torque_Nm": {"value": 0.0301, "std": 0.0004}},
            "score": 400.0,
            "confidence": 0.93,
            "tied_with": ["friction.viscous.yaw"],
            "gain": {
                "holdout_rmse_deg": {"before": {}, "after": {}},
                "holdout_log_likelihood": 123.4,
            },
        },
        {
            "effect": "disturbance.periodic",
            "axis": "roll",
            "parameters": {
                "torque_Nm": {"value": 0.1, "std": 0.01},
                "frequency_Hz": {"value": 0.5, "std": None},
            },
            "score": 40.0,
            "confidence": None,
            "tied_with": [],
            "gain": {
                "holdout_rmse_deg": {"before": {}, "after": {}},
                "holdout_log_likelihood": None,
            },
        },
    ],
    "not_identifiable": ["motor.delay"],
    "leftover": [{"axis": "yaw", "depends_on": "pitch_rate", "share": 0.4, "table": [[0.0, 0.0]]}],
    "next_experiment": {
        "plan": "coast-down",
        "separates": ["friction.coulomb.yaw", "friction.viscous.yaw"],
        "why": "several speeds and reversals",
    },
    "gain": {
        "horizon_s": 1.0,
        "holdout_rmse_deg": {
            "before": {"roll": 1.0, "pitch": None, "yaw": 3.0},
            "after": {"roll": 0.5, "pitch": None, "yaw": 0.3},
            "noise_floor": {"roll": 0.4, "pitch": None, "yaw": 0.2},
        },
        "rmse_reduction_deg": {
            "roll": None,
            "pitch": None,
            "yaw": {"value": 2.7, "interval": [2.5, 2.9]},
        },
    },
    "model": "step-extended.json",
}


def text_of(document: dict[str, Any]) -> str:
    return "\n".join(
        to_markdown(g) if isinstance(g, Grid) else g for g in diagnosis_tables(document)
    )


def changed(**keys: Any) -> dict[str, Any]:
    return {**copy.deepcopy(DOCUMENT), **keys}


def test_the_doctests_pass() -> None:
    assert doctest.testmod(diagnosis_tables_module).failed == 0
    assert doctest.testmod(diagnosis_sentences).failed == 0


def test_a_thrust_gain_is_confounded_with_the_inertias_and_not_with_itself() -> None:
    finding = copy.deepcopy(DOCUMENT["findings"][0])
    finding |= {"effect": "motor.thrust_gain", "axis": None, "tied_with": ["inertia.roll"]}
    text = text_of(changed(findings=[finding]))
    assert "confounded with inertia.roll in any flight" in text


def test_size_confidence_confounding_gain_and_next_experiment_are_reported() -> None:
    text = text_of(DOCUMENT)
    for expected in (
        "friction.coulomb.yaw | torque | 0.03010 | 0.00040 | N·m | 123",
        "An effect is present (confidence 93 %)",
        "frequency | 0.5 | – | Hz",
        "confounded with friction.viscous.yaw: these recordings do not decide between them.",
        "| yaw | 3.000 | 0.300 | +2.700 | 2.500 … 2.900 | 0.200 |",
        "depends on pitch rate, 40 % of the unexplained variance",
        "Not identifiable from these recordings, even if large: motor.delay.",
        "heli3dof run coast-down",
        "+10.0 %",
    ):
        assert expected in text
    assert "| pitch | – |" not in text  # an axis that was not measured has no row


TORQUE: dict[str, Any] = {
    "axis": "yaw", "depends_on": "yaw_rate", "share": 0.3, "like": "friction.viscous.yaw-like",
    "term": "empirical.yaw_rate.yaw", "formula": "c * yaw_rate", "formula_alternatives": [],
    "formula_parameters": {"c": {"value": -0.05, "std": 0.01, "unit": "N·m/(rad/s)"}},
    "gain": DOCUMENT["gain"],
}  # fmt: skip


def test_torques_like_known_effects_are_not_called_unknown() -> None:
    text = text_of(changed(verdict="unexplained", leftover=[TORQUE], next_experiment=None))
    assert "probably the effect friction.viscous.yaw, which these recordings do not" in text
    assert "To confirm friction.viscous.yaw: heli3dof run large" in text
    assert "heli3dof identify REC... --terms +friction.viscous.yaw" in text
    assert "no known cause" not in text
    assert "effect new" not in text
    other = {**TORQUE, "axis": "pitch", "like": None}
    text = text_of(changed(verdict="unexplained", leftover=[TORQUE, other]))
    assert "no known cause" in text
    assert "effect new" in text
    assert "identify REC" not in text


def test_a_fit_that_did_not_converge_is_stated() -> None:
    for document, is_stated in (
        (changed(about={"converged": False}), True),
        (changed(about={"converged": True}), False),
        (DOCUMENT, False),
    ):
        assert ("had not converged" in text_of(document)) == is_stated
        assert (
            "had not converged" in "\n".join(diagnosis_summary.diagnosis_summary(document))
        ) == is_stated


def test_an_error_without_an_explanation_is_stated_in_degrees() -> None:
    rest = {"axis": "pitch", "depends_on": None, "share": 0.0, "term": None, "formula": None}
    rest["error_deg"] = {"simulation": 7.0, "extended_model": 6.2, "noise_floor": None}
    document = changed(verdict="unexplained", leftover=[rest])
    for e in document["simulation_error"].values():
        e["noise_floor_deg"] = None
    text = text_of(document)
    assert "most of the simulation error remains, pitch 6.20° of 7.00° (RMSE of 1 s" in text
    assert "How much of it is noise is unknown." in text
    assert "study its figure" not in text  # it has none


@pytest.mark.parametrize(
    ("after", "low", "V_o_std", "with_causes", "stated"),
    [
        (0.22, 3.5, 0.005, True, True),
        (3.5, 0.3, 0.005, True, False),
        (0.22, 3.5, 0.5, True, False),
        (0.22, 3.5, 0.005, False, False),
    ],
)
def test_a_refit_that_explains_most_of_an_error_is_stated_beside_the_causes(
    after: float, low: float, V_o_std: float, with_causes: bool, stated: bool
) -> None:
    """Refitting lowers roll from 4.13° to 0.22°: the causes alone do not explain the error.

    They do if the calibration does not differ from the profile with the causes in the model, or if
    the refit improves hardly anything in this model.
    """
    won = {"roll": {"value": 4.13 - after, "interval": [low, 4.0]}, "pitch": None}
    error = {"before": {"roll": 4.13, "pitch": None}, "after": {"roll": after, "pitch": None}}
    gain = {"holdout_rmse_deg": error, "rmse_reduction_deg": won}
    gain["explains_with_causes"] = with_causes
    ratios = [{"ratio": "V_o", "nominal": 7.456, "value": 8.222, "std": V_o_std}]
    text = text_of(changed(verdict="explained", calibration_gain=gain, ratios=ratios))
    assert ("Refitted parameters explain one part" in text) is stated
    assert ("profile → refitted → with these causes: roll 4.13° → 0.22° → 0.50°." in text) is stated
    assert ("profile update" in text) is stated
    assert ("V_o = 8.2220 ± 0.0050 V (profile: 7.4560)" in text) is stated


@pytest.mark.parametrize(
    ("ratio", "tied", "lengths", "stated"),
    [(0.5, [], True, True), (0.5, [], False, True), (1.3, [], False, False),
     (0.5, ["encoder.scale.pitch"], False, False)],
)  # fmt: skip
def test_an_inertia_far_from_nominal_shows_a_mistake_in_the_profile(
    ratio: float, tied: list[str], lengths: bool, stated: bool
) -> None:
    """The unmodelled torque may follow from it, so no effect is written for it."""
    J = {"parameter": "J_pitch", "nominal": 0.16, "value": 0.16 * ratio, "std": 0.002}
    J |= {"unit": "kg·m²", "tolerance": 0.15, "beyond_tolerance": "surely"}
    off = {**DOCUMENT["findings"][0], "effect": "inertia", "axis": "pitch", "tied_with": tied}
    document = changed(verdict="unexplained", calibration=[J], findings=[off])
    if lengths:
        document["about"] = {"corrected_lengths_m": {"L_h": {"profile": 0.4, "value": 0.2}}}
    document["leftover"][0] |= {"term": "empirical.yaw.1", "formula": "c * pitch_rate"}
    document["leftover"][0] |= {"formula_alternatives": [], "gain": document["gain"]}
    c = {"value": 0.05, "std": 0.01, "unit": "N·m·s/rad"}
    document["leftover"][0]["formula_parameters"] = {"c": c}
    text = text_of(document)
    assert ("A wrong length or mass in the profile is likely" in text) is stated
    assert ("J_pitch is 0.50 times nominal" in text) is stated
    assert ("With L_h = 0.2 m (profile: 0.4), half the distance" in text) is lengths
    assert ("heli3dof effect new" in text) is not stated


def test_without_a_noise_floor_no_cause_is_not_no_error() -> None:
    document = changed(verdict="nothing_found", findings=[], leftover=[])
    errors = document["simulation_error"].values()
    for e in errors:
        e["noise_floor_deg"] = e["rmse_deg"]
    assert "No simulation error beyond noise was found." in text_of(document)
    document["simulation_error"]["pitch"]["noise_floor_deg"] /= 3
    found = "No effect explains the simulation error, which exceeds the noise on pitch."
    assert found in text_of(document)
    for e in errors:
        e["noise_floor_deg"] = None
    gain = {"holdout_rmse_deg": {"before": {"pitch": 6.89}, "after": {"pitch": 5.79}}}
    text = text_of({**document, "calibration_gain": gain, "ratios": []})
    assert "No simulation error beyond noise was found." not in text
    assert "RMSE on blocks left out of the fit, profile → refitted: pitch 6.89° → 5.79°" in text


def test_the_worst_stretch_is_reported() -> None:
    document = changed()
    worst = {"recording": "step", "start_s": 4.5, "stop_s": 7.5, "rmse_deg": 6.408}
    document["simulation_error"]["pitch"]["worst"] = [worst]
    assert "Worst: pitch 4.5 to 7.5 s of step (6.41°)." in text_of(document)


def test_kept_terms_and_model_deviations_are_reported() -> None:
    size = {"value": 0.009, "std": 0.019, "prior_mean": 0.0, "prior_std": 0.05, "unit": "N·m"}
    kept = {"term": "friction.coulomb.roll", "parameters": {"torque_Nm": size}, "why": "small"}
    about = {
        "not_fitted": ["open-roll-5V-1"],
        "kept_within_what_is_known": [kept],
        "still_hidden": [{"what": "creep", "sentence": "The arm creeps."}],
    }
    text = text_of(changed(about=about))
    assert (
        "Kept in the model, not reported as a cause: friction.coulomb.roll, 0.009 ± 0.019 N·m "
        "(prior: 0.000 ± 0.050); small." in text
    )
    assert "Not explained: The arm creeps." in text
    assert "used to check the fitted model: open-roll-5V-1." in text


def test_without_findings_no_gain_is_reported() -> None:
    text = text_of(
        changed(
            verdict="nothing_found",
            findings=[],
            leftover=[],
            not_identifiable=[],
            next_experiment=None,
        )
    )
    assert "Verdict: nothing found." in text
    assert "Gain" not in text
    assert "Next experiment" not in text


def test_inertias_off_by_one_factor_need_a_scale_and_not_a_flight() -> None:
    scaled = changed()
    scaled["findings"][0].update(effect="inertia", axis="roll", tied_with=["motor.thrust_gain"])
    assert "motor.thrust_gain in any flight: thrust and weight scale together" in text_of(scaled)


def test_the_next_experiment_is_flown_on_the_same_device() -> None:
    device = "mock:?seed=3&hide=motor.lag:0.1"
    text = text_of(changed(about={"device": device}))
    assert f"heli3dof run coast-down --device '{device}'. Reason:" in text
    assert "--device" not in text_of(changed(about={}))


def test_the_next_experiment_is_flown_with_the_same_profile() -> None:
    text = text_of(changed(about={"profile": "lab.toml"}))
    assert "heli3dof run coast-down --profile lab.toml. Reason:" in text
    assert "--profile" not in text_of(changed(about={}))


def test_the_reason_for_no_next_experiment_is_reported() -> None:
    text = text_of(changed(next_experiment=None, about={"no_next_experiment": "nothing is open"}))
    assert "No next experiment is recommended: nothing is open." in text
    assert "Next experiment" not in text


def test_a_faulty_recording_is_reported_with_cause_and_remedy() -> None:
    fault = {
        "check": "encoder.sign",
        "kind": "bad_data",
        "recording": "step",
        "sentence": "step: roll turns the wrong way, to -5.1°.",
        "cause": "the encoder's sign is wrong.",
        "fix": "set encoder.roll = -4096",
    }
    bad = changed(
        verdict="bad_data", findings=[], leftover=[], next_experiment=None, model=None,
        calibration=[], not_identifiable=[], integrity=[fault, {**fault, "kind": "note"}],
    )  # fmt: skip
    text = text_of(bad)
    cause = "Likely cause: the encoder's sign is wrong."
    sentence = f"Recording step: roll turns the wrong way, to −5.1°. {cause} Try: set"
    assert f"\n{sentence}" in text
    assert f"\nNote: {sentence}" in text
    assert "encoder.roll = -4096" in text  # can be copied
    assert "run heli3dof diagnose again" in text
    assert "{" not in text  # sentences, not dictionaries


def test_a_noise_floor_above_the_error_gives_a_warning() -> None:
    noisy = changed()
    noisy["simulation_error"]["pitch"]["noise_floor_deg"] = 9.0
    warning = "the fitted noise is larger than the simulation error"
    assert f"On pitch {warning}" in text_of(noisy)
    assert warning not in text_of(DOCUMENT)


def test_nothing_found_states_the_axes_whose_noise_may_hide_an_effect() -> None:
    noisy = changed(verdict="nothing_found", findings=[], leftover=[], calibration=[])
    beyond_noise = "No simulation error beyond noise was found."
    for e in noisy["simulation_error"].values():
        e["noise_floor_deg"] = e["rmse_deg"]
    assert beyond_noise in text_of(noisy)
    noisy["simulation_error"]["yaw"]["noise_floor_deg"] = 24.0
    assert "the fitted noise may hide one on yaw" in text_of(noisy)
    assert beyond_noise not in text_of(noisy)


def test_a_cause_on_an_axis_with_an_unmodelled_effect_is_only_similar() -> None:
    assert "read it as friction.coulomb.yaw-like" in text_of(DOCUMENT)
    assert "roll-like" not in text_of(DOCUMENT)


def test_a_cause_that_held_out_data_do_not_confirm_is_only_similar() -> None:
    alone = changed(leftover=[])
    assert "yaw-like" not in text_of(alone)
    alone["findings"][0]["like"] = True
    assert "Read it as friction.coulomb.yaw-like" in text_of(alone)


def test_a_cause_that_quick_mode_did_not_test_is_reported_as_that() -> None:
    quick = changed(leftover=[], about={"causes_untested": True})
    quick["findings"][0].update(like=True, confidence=0.5, tied_with=[])
    (text, *_) = causes(quick)
    assert text.endswith("Not tested on left-out blocks: --quick.")
    assert "50 %" not in text
    (line, *_) = diagnosis_summary.causes(quick)
    assert line.endswith("; not tested (--quick).")
    assert "50 %" not in line


def test_each_torque_that_the_model_lacks_is_stated_in_one_sentence() -> None:
    rest = {**changed()["leftover"][0], "term": None, "also": []}
    document = changed(leftover=[rest, {**rest, "axis": "pitch"}])
    sentences = list(unmodelled_effects(document))
    assert len(sentences) == len(set(sentences)) == 2
    assert all(s.endswith(". The extended model does not contain it.") for s in sentences)


def test_slow_noise_is_stated_in_one_sentence() -> None:
    torque = {"axis": "roll", "rms_Nm": 0.0147, "share": 0.4, "table": []}
    (sentence,) = slow_noise({"slow_noise": [torque, {**torque, "axis": "yaw", "rms_Nm": 0.006}]})
    assert sentence.startswith(
        "Slow torque noise on roll (0.015 N·m RMS) and yaw (0.006 N·m RMS): it depends on nothing"
    )
    assert list(slow_noise({})) == []


def test_the_rmse_with_causes_is_stated_once() -> None:
    """Without a cause, the sentence on the unmodelled torque has the same numbers."""
    torque = {**changed()["leftover"][0], "term": "empirical.yaw.1", "formula": None}
    torque["gain"] = DOCUMENT["gain"]
    both = changed(leftover=[torque])
    (line,) = diagnosis_sentences.gain(both)
    assert "refitted → with these causes and the unmodelled torque: roll 1.00° → 0.50°" in line
    alone = changed(leftover=[torque], findings=[])
    assert list(diagnosis_sentences.gain(alone)) == []
    assert "\n".join(diagnosis_summary.diagnosis_summary(alone)).count("1.00° → 0.50°") == 1


def test_missing_null_simulations_are_stated_with_the_reason_and_not_as_a_next_step() -> None:
    about = {"nulls": "Bonferroni over the scores, doubled: flights simulated from the fit diverge"}
    document = changed(about=about)
    sentence = "There are no null simulations (flights simulated from the fit diverge)"
    assert sentence in text_of(document)
    assert sentence not in "\n".join(diagnosis_sentences.next_steps(document))


def test_a_recordings_name_is_not_read_as_a_label() -> None:
    fault = {"kind": "bad_data", "recording": "missing", "cause": "", "fix": ""}
    document = {"integrity": [{**fault, "sentence": "missing: 3 of 9 samples are missing."}]}
    assert list(diagnosis_sentences.faults(document)) == [
        "Recording missing: 3 of 9 samples are missing."
    ]


def test_an_unconfirmed_candidate_is_reported_as_not_adopted() -> None:
    dropped = {
        "effect": "motor.delay",
        "gain": {"holdout_log_likelihood_interval": [-24.0, 110.0]},
    }
    text = text_of(changed(verdict="nothing_found", findings=[], dropped=[dropped]))
    assert "A further effect (motor.delay) would fit better" in text
    assert "Not adopted: motor.delay" in text
    assert "(ln L −24 … 110)" in text


def test_an_encoder_scale_needs_a_turn_by_hand_and_not_a_larger_flight() -> None:
    hidden = ["motor.delay", "encoder.offset.yaw", "encoder.scale.pitch", "encoder.scale.yaw"]
    text = text_of(changed(not_identifiable=hidden))
    assert "encoder.offset.yaw is not identifiable from any flight" in text
    assert "even if large: motor.delay.\n" in text
    assert "encoder.scale.pitch or encoder.scale.yaw within the profile's tolerance is not" in text
    assert "turn pitch and yaw by hand through a known angle" in text


def test_a_parameter_insignificantly_beyond_its_tolerance_is_no_finding() -> None:
    plain = changed(verdict="nothing_found", findings=[], leftover=[], next_experiment=None)
    row = {**plain["calibration"][0], "value": 0.79, "std": 0.031, "tolerance": 0.15}
    plain["calibration"] = [{**row, "beyond_tolerance": "not_surely"}]
    text = text_of(plain)
    assert (
        "T_g is estimated 21.0 % below the profile's value (± 3.1 %). This is not significantly "
        "beyond the tolerance of 15 %, so it is no finding." in text
    )
    assert "But T_g may be off" in text
    assert "To settle T_g: weigh" in text
    plain["calibration"] = [{**row, "std": 0.01, "beyond_tolerance": "not_surely"}]
    assert "(± 1.0 %). This exceeds the tolerance of 15 %. It is no finding:" in text_of(plain)
    for clear in ("no", "surely"):
        plain["calibration"] = [{**row, "beyond_tolerance": clear}]
        assert "not significantly" not in text_of(plain)


def test_an_ambiguous_verdict_names_the_causes_that_are_not_separated() -> None:
    assert "do not separate friction.coulomb.yaw and friction.viscous.yaw." in text_of(DOCUMENT)
    many = [f"motor.effect_{n}" for n in range(9)]
    text = text_of(changed(findings=[{**DOCUMENT["findings"][0], "tied_with": many}]))
    assert "motor.effect_3 and 5 other causes." in text
    unconfirmed = {**DOCUMENT["findings"][0], "tied_with": [], "like": True}
    text = text_of(changed(findings=[unconfirmed]))
    assert "these recordings do not confirm friction.coulomb.yaw." in text


def test_every_sentence_states_the_same_data_on_which_the_gain_was_measured() -> None:
    gain = {**DOCUMENT["gain"], "measured_on": "the recordings themselves"}
    text = text_of(changed(gain=gain, model="model.json"))
    assert "The gain was measured on the fitted recordings themselves" in text
    assert "blocks left out" not in text


def test_the_readmes_session_shows_the_verdict_and_the_cause() -> None:
    assert "docs/pictures/terminal.svg" in (ROOT / "README.md").read_text(encoding="utf-8")
    picture = (ROOT / "docs" / "pictures" / "terminal.svg").read_text(encoding="utf-8")
    text = re.sub(r"<[^>]*>|\s+", " ", picture.replace("&#160;", " "))
    assert VERDICTS["explained"] in text
    assert "Cause 1: stiffness.cable.yaw, stiffness 0.1002 ± 0.0032 N·m/rad" in text


def test_the_consequence_of_an_unknown_controller_is_reported() -> None:
    log = changed(about={"nulls": "Bonferroni over the probes, doubled"})
    assert "add [controller] to the profile" in text_of(log)
    assert "[controller]" not in text_of(DOCUMENT)
