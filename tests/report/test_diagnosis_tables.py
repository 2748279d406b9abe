"""A diagnosis told: every sentence that a teacher needs, written from the document alone."""

from __future__ import annotations

import copy
import doctest
from typing import Any

from heli3dof.report import diagnosis_tables as module
from heli3dof.report.diagnosis_tables import diagnosis_tables, split_unit
from heli3dof.report.diagnosis_text import VERDICTS, summary_of
from heli3dof.report.text_table import Grid, to_markdown
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


def told(document: dict[str, Any]) -> str:
    return "\n".join(
        to_markdown(g) if isinstance(g, Grid) else g for g in diagnosis_tables(document)
    )


def test_the_doctests() -> None:
    assert doctest.testmod(module).failed == 0


def test_size_certainty_tie_gain_and_the_next_flight_are_said() -> None:
    text = told(DOCUMENT)
    for words in (
        "friction.coulomb.yaw | torque | 0.03010 | 0.00040 | N·m | 123",
        "Something is there (93 %)",
        "frequency | 0.5 | – | Hz",
        "it cannot be told from friction.viscous.yaw by these recordings",
        "| yaw | 3.000 | 0.300 | +2.700 | 2.500 … 2.900 | 0.200 |",
        "depends on pitch rate, 40 % of what is unexplained",
        "could not show even a large motor.delay",
        "heli3dof run coast-down",
        "+10.0 %",
    ):
        assert words in text
    assert "| pitch | – |" not in text  # an axis that was not measured is not a row of dashes


def test_the_worst_stretch_is_named() -> None:
    document = copy.deepcopy(DOCUMENT)
    worst = {"recording": "step", "start_s": 4.5, "stop_s": 7.5, "rmse_deg": 6.408}
    document["simulation_error"]["pitch"]["worst"] = [worst]
    assert "Worst: pitch 4.5 to 7.5 s of step (6.41°)." in told(document)


def test_what_is_kept_but_no_cause_and_what_is_still_hidden_are_said() -> None:
    document = copy.deepcopy(DOCUMENT)
    size = {"value": 0.009, "std": 0.019, "prior_mean": 0.0, "prior_std": 0.05, "unit": "N·m"}
    kept = {"term": "friction.coulomb.roll", "parameters": {"torque_Nm": size}, "why": "small"}
    document["about"] = {
        "not_fitted": ["open-roll-5V-1"],
        "kept_within_what_is_known": [kept],
        "still_hidden": [{"what": "creep", "sentence": "The arm creeps."}],
    }
    text = told(document)
    assert (
        "Kept in the model, but not named a cause: friction.coulomb.roll, 0.009 ± 0.019 N·m "
        "(known beforehand: 0.000 ± 0.050); small." in text
    )
    assert "Still hidden: The arm creeps." in text
    assert "held beside the model: open-roll-5V-1." in text


def test_where_nothing_was_found_no_gain_is_claimed() -> None:
    plain = copy.deepcopy(DOCUMENT)
    plain.update(
        verdict="nothing_found", findings=[], leftover=[], not_identifiable=[], next_experiment=None
    )
    text = told(plain)
    assert "Nothing was found that noise alone would not explain" in text
    assert "mending" not in text
    assert "Fly next" not in text


def test_inertias_that_are_one_factor_are_not_to_be_flown_but_weighed() -> None:
    scaled = copy.deepcopy(DOCUMENT)
    scaled["findings"][0].update(effect="inertia", axis="roll", tied_with=["motor.thrust_gain"])
    assert "motor.thrust_gain by any flight: thrust and weight scale together" in told(scaled)


def test_where_no_plan_is_recommended_it_is_said_why() -> None:
    plain = copy.deepcopy(DOCUMENT)
    plain.update(next_experiment=None, about={"no_next_experiment": "nothing is open"})
    text = told(plain)
    assert "No plan is recommended: nothing is open." in text
    assert "Fly next" not in text


def test_a_fault_of_the_recording_is_said_with_its_cause_and_a_remedy() -> None:
    bad = copy.deepcopy(DOCUMENT)
    fault = {
        "check": "encoder.sign",
        "kind": "bad_data",
        "sentence": "step: roll turns the wrong way.",
        "cause": "the encoder's sign is wrong.",
        "fix": "set encoder.roll = 4096",
    }
    bad.update(
        verdict="bad_data", findings=[], leftover=[], next_experiment=None, model=None,
        calibration=[], not_identifiable=[], integrity=[fault, {**fault, "kind": "note"}],
    )  # fmt: skip
    text = told(bad)
    said = "step: roll turns the wrong way. Likely cause: the encoder's sign is wrong. Try: set"
    assert f"\n{said}" in text
    assert f"\nNote: {said}" in text
    assert "diagnose once more" in text
    assert "{" not in text  # sentences, not dictionaries


def test_noise_above_the_error_is_no_floor_and_is_said_to_be_none() -> None:
    noisy = copy.deepcopy(DOCUMENT)
    noisy["simulation_error"]["pitch"]["noise_floor_deg"] = 9.0
    assert "On pitch the fitted model expects more noise" in told(noisy)
    assert "expects more noise" not in told(DOCUMENT)


def test_a_cause_beside_something_unknown_on_its_axis_is_only_alike() -> None:
    assert "read it as friction.coulomb.yaw-like" in told(DOCUMENT)
    assert "roll-like" not in told(DOCUMENT)


def test_a_cause_that_held_out_data_do_not_surely_confirm_is_only_alike() -> None:
    alone = copy.deepcopy(DOCUMENT)
    alone["leftover"] = []
    assert "yaw-like" not in told(alone)
    alone["findings"][0]["like"] = True
    assert "do not surely confirm it: read it as friction.coulomb.yaw-like" in told(alone)


def test_a_cause_that_is_not_confirmed_is_told_as_such() -> None:
    dropped = {
        "effect": "motor.delay",
        "gain": {"holdout_log_likelihood_interval": [-24.0, 110.0]},
    }
    text = told({**DOCUMENT, "verdict": "nothing_found", "findings": [], "dropped": [dropped]})
    assert "not confirmed by data that it has not seen" in text
    assert "Not adopted: motor.delay" in text
    assert "(ln L −24 … 110)" in text


def test_what_no_flight_can_tell_is_not_said_to_want_a_larger_one() -> None:
    dark = ["motor.delay", "encoder.scale.pitch", "encoder.scale.yaw"]
    text = told({**DOCUMENT, "not_identifiable": dark})
    assert "could not show even a large motor.delay: of" in text
    assert "tolerance encoder.scale.pitch or encoder.scale.yaw may be there, and no flight" in text
    assert "turn pitch and yaw by hand through an angle" in text


def test_a_base_number_that_is_far_off_and_not_surely_so_is_said_to_be() -> None:
    plain = copy.deepcopy(DOCUMENT)
    plain.update(verdict="nothing_found", findings=[], leftover=[], next_experiment=None)
    row = {**plain["calibration"][0], "value": 0.79, "std": 0.031, "tolerance": 0.15}
    plain["calibration"] = [{**row, "beyond_tolerance": "not_surely"}]
    text = told(plain)
    assert (
        "T_g is estimated 21.0 % below the profile's (± 3.1 %); that is not surely beyond the "
        "15 % to which it is believed, so it is no finding." in text
    )
    assert "But T_g may be off" in text
    assert "To settle T_g: weigh" in text
    for sure in ("no", "surely"):
        plain["calibration"] = [{**row, "beyond_tolerance": sure}]
        assert "not surely" not in told(plain)


def test_the_readme_quotes_what_is_said() -> None:
    text = " ".join((ROOT / "README.md").read_text(encoding="utf-8").replace("> ", "").split())
    name = "stiffness.cable.yaw"
    assert VERDICTS["explained"] in text
    assert f"{name}: {summary_of(name)}" in text


def test_what_an_unknown_loop_costs_is_said() -> None:
    log = {**DOCUMENT, "about": {"nulls": "Bonferroni over the probes, doubled"}}
    assert "add [controller] to the profile" in told(log)
    assert "[controller]" not in told(DOCUMENT)


def test_an_unknown_unit_stays_in_the_parameter_s_name() -> None:
    assert split_unit("flux_Wb") == ("flux_Wb", "")
    assert split_unit("damping_Nms_per_rad") == ("damping", "N·m·s/rad")
