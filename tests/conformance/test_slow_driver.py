"""A driver may be slow once, on a busy computer."""

from __future__ import annotations

import time
from collections.abc import Sequence

import pytest

from heli3dof.rig.conformance import NotConforming, conforms
from tests.conformance.test_suite import CASE, Driver, use


@pytest.mark.usefixtures("own_clock")
def test_a_driver_that_is_always_slow_fails_and_one_that_is_slow_once_conforms(
    monkeypatch: pytest.MonkeyPatch,
):
    case = CASE["find_returns_urls_of_the_drivers_scheme_within_a_second"]
    waits = [1.5, 0.1]

    class SlowToFind(Driver):
        def find(self) -> Sequence[str]:
            time.sleep(waits.pop(0) if waits else 1.5)
            return ["spoilt:"]

    use(monkeypatch, SlowToFind)
    conforms(case, "spoilt:?speed=max")
    with pytest.raises(NotConforming, match=r"1\.5\d s"):
        conforms(case, "spoilt:?speed=max")
