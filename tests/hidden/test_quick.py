"""The quick part of the hidden bench: two flights of the classes, flown whole, diagnosed quickly.

The whole is `make bench-hidden`. These seeds are development's, not the final tables'.
"""

from __future__ import annotations

from tests.hidden.cases import Truth
from tests.hidden.judge import Verdict, judge
from tests.hidden.run import one


def verdict(group: str, seed: int) -> Verdict:
    line = one(group, seed, "quick")
    assert "document" in line, line.get("traceback")
    return judge(line["document"], Truth(**line["truth"]))


def test_large_dry_friction_in_yaw_is_the_first_cause_and_no_wrong_name_is_asserted() -> None:
    v = verdict("rich-large", 1001)
    assert v.first
    assert not v.wrong


def test_a_plain_run_step_in_which_nothing_is_hidden_raises_no_alarm() -> None:
    assert not verdict("run-step-nothing", 1000).said
