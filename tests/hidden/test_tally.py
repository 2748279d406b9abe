"""Rates are counts over the right cases."""

from __future__ import annotations

from typing import Any

import pytest

from tests.hidden.tally import (
    Rate,
    confusions,
    judged,
    largest_deviation,
    median_error,
    rates,
    statements,
    summary,
)
from tests.hidden.test_judge import document, finding


def line(group: str, hidden: str = "", report: dict[str, Any] | None = None) -> dict[str, Any]:
    values = {hidden: {"torque_Nm": 0.02}} if hidden else {}
    truth = {"names": list(values), "unseen": [], "values": values}
    kept = {"case": f"{group}-1", "group": group, "seed": 1, "truth": truth, "wall_s": 2.0}
    return {**kept, "document": report} if report is not None else {**kept, "error": "it failed"}


RIGHT = document(finding("friction.coulomb", "yaw", torque_Nm=(0.022, 0.002)))
LINES = [
    line("rich-large", "friction.coulomb.yaw", RIGHT),
    line("rich-large", "friction.coulomb.yaw", document(finding("motor.delay"))),
    line("rich-medium", "friction.coulomb.yaw", document()),
    line("rich-large", "encoder.scale.yaw", document()),
    line("rich-nothing", "", document()),
    line("steps-nothing", "", document(finding("motor.delay"))),
]


def rate(cases: list[dict[str, Any]], what: str) -> Rate:
    (report,) = [r for r in rates(judged(cases)) if r.what == what]
    return report


def test_an_encoder_scale_is_in_no_rate_of_hits() -> None:
    r = rate(LINES, "right cause first, rich plan, medium and large")
    assert (r.hits, r.of, r.met) == (1, 3, False)


def test_false_alarms_are_counted_by_plan() -> None:
    assert rate(LINES, "false alarms where nothing is hidden, rich").text == "0.0 % (0/1)"
    assert rate(LINES, "false alarms where nothing is hidden, steps").text == "100.0 % (1/1)"


def test_a_share_has_an_interval_for_its_number_of_cases() -> None:
    # Wilson: 0 of n leaves up to z²/(n + z²), z = 1.96.
    assert Rate("", 0, 10).interval == pytest.approx((0.0, 3.8415 / 13.8415), abs=1e-3)
    assert Rate("", 0, 1).between == "0.0 to 79.3 %"
    assert Rate("", 97, 100).interval[0] < 0.97 < Rate("", 97, 100).interval[1]


def test_wrong_names_are_counted_over_all_asserted_names() -> None:
    r = rate(LINES, "names asserted without a tie that are wrong, over everything")
    assert (r.hits, r.of) == (2, 3)


def test_a_diagnosis_that_fails_is_a_miss_and_an_alarm() -> None:
    failed = [line("rich-large", "friction.coulomb.yaw"), line("rich-nothing")]
    assert rate(failed, "right cause first, rich plan, medium and large").hits == 0
    assert rate(failed, "false alarms where nothing is hidden, rich").hits == 1
    assert rate(failed, "diagnoses that failed").text == "100.0 % (2/2)"


def test_an_aborted_flight_is_counted_and_excluded() -> None:
    tripped = {"case": "rich-pair-1", "group": "rich-pair", "seed": 1, "not_flown": "tripped: roll"}
    what = "flights that did not reach their end (left out)"
    assert rate([*LINES, tripped], what).hits == 1


def test_the_error_is_the_median_over_named_causes() -> None:
    assert median_error(judged(LINES)) == pytest.approx(0.1)


def test_confusions_list_the_names_found_instead() -> None:
    report = {(hidden, group): text for hidden, group, _, _, text in confusions(judged(LINES))}
    assert report["friction.coulomb.yaw", "rich-large"] == "friction.coulomb.yaw, motor.delay"
    assert report["friction.coulomb.yaw", "rich-medium"] == "nothing_found"


def test_the_summary_contains_every_rate() -> None:
    text = summary(LINES)
    for r in rates(judged(LINES)):
        assert r.what in text


def test_a_confidence_counts_as_right_for_a_cause_confounded_with_the_truth() -> None:
    tied = document({**finding("motor.delay", None, "friction.coulomb.yaw"), "confidence": 0.9})
    (j,) = judged([line("rich-large", "friction.coulomb.yaw", tied)])
    assert statements(j) == [(0.9, True)]


def test_nine_right_statements_of_ten_with_confidence_0_9_deviate_by_nothing() -> None:
    said = {**finding("friction.coulomb", "yaw"), "confidence": 0.9}
    right = line("rich-large", "friction.coulomb.yaw", document(said))
    wrong = line("rich-nothing", "", document(said))
    deviation, number = largest_deviation(judged(18 * [right] + 2 * [wrong]))
    assert (deviation, number) == (pytest.approx(0.0), 20)
    assert largest_deviation(judged(20 * [right]))[0] == pytest.approx(0.1)
