"""Bars on the closed-loop replay of held-out flights of the emulated rig.

The best black boxes tried before the project reached 83–86 % (multisine), 68–80 % (steps alone)
and 59–62 % (large) in pitch; the bars are a point below the upper ends. ``make bench`` measures
the same over more seeds.
"""

from __future__ import annotations

import pytest

from heli3dof.identification.identify import identify
from tests.identification.mock_flights import mock_flight


@pytest.mark.parametrize(("plan", "pitch"), [("multisine", 85.0), ("steps", 79.0), ("large", 61.0)])
def test_pem_replays_held_out_flights_above_the_bar(plan: str, pitch: float) -> None:
    result = identify(mock_flight(plan, 1), holdout=mock_flight(plan, 11), method="pem")
    fit = result.metrics.replay.fit_percent
    assert fit[0] > 95
    assert fit[1] > pitch
    assert fit[2] > 95
