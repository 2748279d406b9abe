"""Quick part of the hidden-cause benchmark: two whole flights, diagnosed with `--quick`.

`make bench-hidden` runs all. These seeds are for development, not for the final tables.
"""

from __future__ import annotations

from tests.hidden.cases import Truth
from tests.hidden.judge import Verdict, judge
from tests.hidden.run import one


def verdict(group: str, seed: int) -> Verdict:
    line = one(group, seed, "quick")
    assert "document" in line, line.get("traceback")
    return judge(line["document"], Truth(**line["truth"]))


def test_large_coulomb_friction_in_yaw_is_the_first_cause_and_no_asserted_name_is_wrong() -> None:
    v = verdict("rich-large", 1001)
    assert v.first
    assert not v.wrong


def test_a_step_flight_of_the_unmodified_rig_raises_no_alarm() -> None:
    assert not verdict("run-step-nothing", 1000).reported
