"""How long a look at the doors may take, where the machine has other work as well."""

from __future__ import annotations

import time
from collections.abc import Sequence

import pytest

from heli3dof.rig.conformance import NotConforming, conforms
from tests.conformance.test_suite import CASE, Driver, use


@pytest.mark.usefixtures("own_clock")
def test_a_driver_that_is_slow_once_was_held_up_and_one_that_always_is_does_not_conform(
    monkeypatch: pytest.MonkeyPatch,
):
    case = CASE["a_driver_finds_its_rigs_in_no_time_by_urls_of_its_scheme"]
    waits = [1.5, 0.1]

    class SlowToFind(Driver):
        def find(self) -> Sequence[str]:
            time.sleep(waits.pop(0) if waits else 1.5)
            return ["spoilt:"]

    use(monkeypatch, SlowToFind)
    conforms(case, "spoilt:?speed=max")
    with pytest.raises(NotConforming, match=r"1\.5\d s"):
        conforms(case, "spoilt:?speed=max")
