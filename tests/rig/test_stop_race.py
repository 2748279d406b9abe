"""No rig is armed after an emergency stop has been confirmed, however early in a flight it comes.

`make bench TOPIC=estop` runs two hundred of these.
"""

from __future__ import annotations

import pytest

from tests.rig.stop_race import race

pytestmark = pytest.mark.realtime


@pytest.mark.parametrize("kind", ["mock", "firmware"])
@pytest.mark.parametrize(("moment_s", "everything"), [(0.0, False), (0.4, True), (0.9, False)])
def test_a_stop_wins_against_a_starting_flight(
    kind: str, moment_s: float, everything: bool
) -> None:
    seen = race(kind, moment_s, everything=everything)
    assert seen.enabled_after_s == 0, seen
    assert seen.code == 4, seen
